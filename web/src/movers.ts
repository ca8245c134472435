// SPDX-License-Identifier: Apache-2.0
// Movers as boxes with arrows of where they will be in a second, and their labels.
import * as THREE from "three";

export type Mover = { id: number; class: string; position: number[]; velocity: number[]; size: number[]; box: number[] };

export class MoverView {
  readonly group = new THREE.Group();
  // What is drawn is made once: what WebGL holds goes only when it is disposed of.
  private box = new THREE.EdgesGeometry(new THREE.BoxGeometry(1, 1, 1));
  private material = new THREE.LineBasicMaterial();
  private shapes: { box: THREE.LineSegments; arrow: THREE.ArrowHelper }[] = [];
  private labels: HTMLDivElement[] = [];
  private list: Mover[] = [];
  private colour = "";

  constructor(private overlay: HTMLElement) {}

  take(movers: Mover[], camera: THREE.Matrix4 | null): void {
    this.list = movers;
    movers.forEach((m, i) => {
      const { box, arrow } = (this.shapes[i] ??= this.shape());
      box.visible = true;
      box.position.fromArray(m.position);
      box.scale.fromArray(m.size.map((s) => Math.max(0.1, s)));
      if (camera) box.quaternion.setFromRotationMatrix(camera);
      const v = new THREE.Vector3().fromArray(m.velocity), speed = v.length();
      arrow.visible = speed > 0.05;
      if (!arrow.visible) return;
      arrow.position.copy(box.position);
      arrow.setDirection(v.divideScalar(speed));
      arrow.setLength(speed, 0.15, 0.08);
    });
    for (const { box, arrow } of this.shapes.slice(movers.length)) box.visible = arrow.visible = false;
  }
  private shape(): { box: THREE.LineSegments; arrow: THREE.ArrowHelper } {
    const box = new THREE.LineSegments(this.box, this.material), arrow = new THREE.ArrowHelper();
    arrow.setColor(this.colour);
    this.group.add(box, arrow);
    return { box, arrow };
  }
  paint(colour: string): void {
    this.colour = colour;
    this.material.color.set(colour);
    for (const { arrow } of this.shapes) arrow.setColor(colour);
  }
  label(view: DOMRect, camera: THREE.Camera): void {
    let used = 0;
    const p = new THREE.Vector3();
    if (this.group.visible)
      for (const m of this.list) {
        p.fromArray(m.position);
        p.y -= m.size[1] / 2;
        p.project(camera);
        if (p.z > 1 || Math.abs(p.x) > 1 || Math.abs(p.y) > 1) continue;
        let label = this.labels[used];
        if (!label) {
          label = document.createElement("div");
          label.className = "label";
          this.overlay.appendChild(label);
          this.labels.push(label);
        }
        const speed = Math.hypot(...m.velocity);
        label.textContent = `${m.class} ${m.id}  ${speed.toFixed(1)} m/s`;
        label.style.transform = `translate(${((p.x + 1) / 2) * view.width}px, ${((1 - p.y) / 2) * view.height}px) translate(-50%, -110%)`;
        label.hidden = false;
        used++;
      }
    for (let i = used; i < this.labels.length; i++) this.labels[i].hidden = true;
  }
}
