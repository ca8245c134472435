# SPDX-License-Identifier: Apache-2.0
"""What the node's diagnostics and its process say of a run; for the measurements of both ROS."""
import os


def cpu_seconds(pid):
    fields = open(f"/proc/{pid}/stat").read().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def summary(statuses):
    """Of diagnostic statuses, a second each: {"frames", "dropped", "overhead mean [ms]", ...}"""
    rows = [{v.key: v.value for v in s.values} for s in statuses]
    rows = [r for r in rows if float(r["rate [1/s]"]) > 0]
    weights = [float(r["rate [1/s]"]) for r in rows]
    result = {key: rows[-1][key] for key in ("frames", "tracked", "dropped", "unpaired", "late", "waiting")}
    for name in ("tracking", "latency", "overhead"):
        means = [float(r[f"{name} mean [ms]"]) for r in rows]
        result[f"{name} mean [ms]"] = round(sum(m * w for m, w in zip(means, weights)) / sum(weights), 2)
        result[f"{name} median of seconds [ms]"] = sorted(means)[len(means) // 2]
    return result
