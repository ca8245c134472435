#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Parts of scripts/soak.sh: the closed path, and the plot of what soak_bench measured. Needs nothing but Python.

  scripts/soak.py path path.txt
  scripts/soak.py plot soak.csv docs/images/soak.svg
"""
import argparse
import csv
import math
import pathlib

PERIOD = 120.0  # [s]; all frequencies below are whole multiples of 1 / PERIOD, so that the path closes smoothly


def turns(n, t, phase=0.0):
    return 2 * math.pi * (n * t / PERIOD + phase)


def camera(t):
    """Position and quaternion (x, y, z, w) of world_from_cam: three rounds of a room of 4 x 3 m, each a bit different,
    looking along the path and to its sides."""
    size = 1 + 0.18 * math.sin(turns(1, t))
    around = turns(3, t)
    position = (1.3 * size * math.cos(around), 0.9 * size * math.sin(around), 1.35 + 0.12 * math.sin(turns(2, t, 0.2)))
    ahead = math.atan2(0.9 * math.cos(around), -1.3 * math.sin(around))
    yaw = ahead + 0.6 * math.sin(turns(5, t, 0.1))
    pitch = -0.28 + 0.12 * math.sin(turns(4, t, 0.3))
    roll = 0.04 * math.sin(turns(7, t))
    # Columns: the picture's right, its down, the optical axis.
    f = (math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch))
    r = (math.sin(yaw), -math.cos(yaw), 0.0)
    d = (f[1] * r[2] - f[2] * r[1], f[2] * r[0] - f[0] * r[2], f[0] * r[1] - f[1] * r[0])
    c, s = math.cos(roll), math.sin(roll)
    r, d = [c * a + s * b for a, b in zip(r, d)], [c * b - s * a for a, b in zip(r, d)]
    return position, quaternion([[r[i], d[i], f[i]] for i in range(3)])


def quaternion(m):
    """The four squares, of which the largest is safe to divide by."""
    trace = m[0][0] + m[1][1] + m[2][2]
    squares = [1 + 2 * m[i][i] - trace for i in range(3)] + [1 + trace]
    k = squares.index(max(squares))
    if k == 3:
        q = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1], squares[3]]
    else:
        i, j, l = k, (k + 1) % 3, (k + 2) % 3
        q = [0.0] * 4
        q[i], q[j], q[l], q[3] = squares[k], m[i][j] + m[j][i], m[i][l] + m[l][i], m[l][j] - m[j][l]
    norm = math.sqrt(sum(v * v for v in q))
    return [v / norm for v in q]


def write_path(file):
    lines = ["# timestamp tx ty tz qx qy qz qw\n"]
    for i in range(int(PERIOD * 60) + 1):
        position, rotation = camera(i / 60)
        lines.append(f"{i / 60:.6f} " + " ".join(f"{v:.9f}" for v in (*position, *rotation)) + "\n")
    pathlib.Path(file).write_text("".join(lines))


def nice_step(span):
    """Distance of about four lines in `span`: 1, 2 or 5 times a power of ten."""
    power = 10 ** math.floor(math.log10(span / 4))
    return next(s * power for s in (1, 2, 5, 10) if s * power >= span / 4)


def panel(rows, columns, title, top, height=150, left=60, width=640):
    """One diagram over the frames, from zero. `columns`: (name in the file, its legend, colour)."""
    thousands = [float(r["frames"]) / 1000 for r in rows]
    highest = max(float(r[name]) for r in rows for name, _, _ in columns) * 1.08
    x = lambda t: left + width * t / max(thousands)
    y = lambda v: top + height - height * v / highest
    out = [f'<text x="{left}" y="{top - 8}" font-weight="bold">{title}</text>']
    step = nice_step(highest)
    for k in range(int(highest / step) + 1):
        out.append(f'<path d="M{left} {y(k * step):.1f}h{width}" stroke="#ddd"/>')
        out.append(f'<text x="{left - 6}" y="{y(k * step) + 4:.1f}" text-anchor="end">{k * step:g}</text>')
    for before, after in zip(rows, rows[1:]):
        if before["round"] != after["round"]:
            out.append(f'<path d="M{x(float(before["frames"]) / 1000):.1f} {top}v{height}" stroke="#ddd"/>')
    step = nice_step(max(thousands))
    for k in range(int(max(thousands) / step) + 1):
        out.append(f'<text x="{x(k * step):.1f}" y="{top + height + 15}" text-anchor="middle">{k * step:g}</text>')
    for i, (name, legend, colour) in enumerate(columns):
        points = " ".join(f"{x(t):.1f},{y(float(r[name])):.1f}" for t, r in zip(thousands, rows))
        out.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        if legend:
            at = left + width - 130 * (len(columns) - 1 - i)
            out.append(f'<text x="{at}" y="{top - 8}" text-anchor="end" fill="{colour}">{legend}</text>')
    return out


def plot(table, picture):
    with open(table, newline="") as file:
        rows = list(csv.DictReader(file))
    blue, orange = "#2563a8", "#c25a10"
    panels = [
        ("Keyframes", [("keyframes_inserted", "ever made", orange), ("keyframes", "in the map", blue)]),
        ("Points in the map", [("points", "", blue)]),
        ("Memory [MB]", [("rss_mb", "resident", orange), ("in_use_mb", "in use", blue)]),
        ("Tracking, CPU [ms a frame]", [("cpu_p95_ms", "95%", orange), ("cpu_mean_ms", "mean", blue)]),
        ("Mapping and loop search [ms a keyframe]", [("loop_ms", "loop search", orange), ("mapping_ms", "mapping", blue)]),
        ("Longest global adjustment [ms]", [("global_ba_ms", "", blue)]),
    ]
    height = 190 * len(panels) + 40
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="730" height="{height}" font-family="sans-serif" font-size="12">',
           f'<rect width="730" height="{height}" fill="white"/>']
    for i, (title, columns) in enumerate(panels):
        out += panel(rows, columns, title, 30 + 190 * i)
    out.append(f'<text x="380" y="{height - 12}" text-anchor="middle">thousand frames '
               '(a line each time the path starts anew)</text></svg>')
    pathlib.Path(picture).write_text("\n".join(out) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    path = commands.add_parser("path", help="write the closed path as a trajectory")
    path.add_argument("out")
    picture = commands.add_parser("plot", help="draw the table that soak_bench writes")
    picture.add_argument("table")
    picture.add_argument("out")
    arguments = parser.parse_args()
    if arguments.command == "path":
        write_path(arguments.out)
    else:
        plot(arguments.table, arguments.out)


if __name__ == "__main__":
    main()
