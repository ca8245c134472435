// SPDX-License-Identifier: Apache-2.0
// Which map is shown. Maps that are not joined have worlds of their own, so that one alone is shown: the camera's, or that
// of an event that the visitor has gone to.

export class Maps {
  private keyframes = new Map<number, { root: number; culled: boolean }>(); // by id
  private byAge: number[] | null = null; // the roots
  private camera = -1; // the root of the camera's map; none was told yet
  private visited = -1; // the root of an event's map, as long as that is looked at

  clear(): void {
    this.keyframes.clear();
    this.camera = this.visited = -1;
    this.byAge = null;
  }
  // Whether it is new, or has come or gone.
  take(id: number, root: number, culled: boolean): boolean {
    const before = this.keyframes.get(id);
    if (before?.root !== root) this.byAge = null;
    this.keyframes.set(id, { root, culled });
    return before?.culled !== culled;
  }
  has(id: number): boolean {
    return this.keyframes.has(id);
  }
  lives(id: number): boolean {
    return this.keyframes.get(id)?.culled === false;
  }
  *living(): Generator<number> {
    for (const [id, k] of this.keyframes) if (!k.culled) yield id;
  }
  // A keyframe's root; what was a root before maps were joined hangs on another one.
  root(id: number): number {
    return this.keyframes.get(id)?.root ?? id;
  }
  // A negative one tells of none: the camera is lost, and its last map stays.
  takeCamera(root: number): void {
    if (root < 0 || root === this.camera) return;
    this.camera = root;
    this.byAge = null;
  }
  visit(host: number): void {
    this.visited = this.root(host) === this.root(this.camera) ? -1 : this.root(host);
  }
  leave(): void {
    this.visited = -1;
  }
  // The root of the map that is shown; the oldest one before the camera is in any.
  get shown(): number {
    const asked = this.visited >= 0 ? this.visited : this.camera;
    return asked >= 0 ? this.root(asked) : this.roots()[0] ?? -1;
  }
  get showsCamera(): boolean {
    return this.camera < 0 || this.root(this.camera) === this.shown;
  }
  shows(host: number): boolean {
    return this.root(host) === this.shown;
  }
  private roots(): number[] {
    if (this.byAge) return this.byAge;
    const roots = new Set([...this.keyframes.values()].map((k) => k.root));
    if (this.camera >= 0) roots.add(this.root(this.camera)); // of a new map whose keyframes are not told yet
    return (this.byAge = [...roots].sort((a, b) => a - b));
  }
  // For people; empty where there is one map.
  get words(): string {
    const roots = this.roots();
    return roots.length > 1 ? `map ${roots.indexOf(this.shown) + 1} of ${roots.length}, not joined` : "";
  }
}
