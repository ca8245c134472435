# SPDX-License-Identifier: Apache-2.0
"""Scores and pictures are those of the command line."""
import json
import xml.dom.minidom

import dkb_slam
import numpy as np
import pytest


@pytest.fixture(scope="module")
def slam(sequence):
    source = dkb_slam.open(sequence)
    slam = dkb_slam.Slam(source.camera)
    for frame in source:
        slam.process(frame)
    slam.finish()
    return slam


def test_the_score_is_that_of_eval_json(slam, sequence, command_line, tmp_path):
    truth, estimate = sequence / "groundtruth.txt", tmp_path / "trajectory.txt"
    slam.save_trajectory(estimate)
    command_line("eval", truth, estimate, "--json", tmp_path / "score.json", "--rpe-delta", "2f")
    score = dkb_slam.evaluate(truth, estimate, rpe_delta="2f")
    assert score == json.loads((tmp_path / "score.json").read_text())
    assert score["ape"]["translation_m"]["rmse"] < 0.02
    by_slam = dkb_slam.evaluate(truth, slam, rpe_delta="2f")  # nine decimals are in the file
    assert by_slam["matched"] == 40
    assert by_slam["ape"]["translation_m"]["rmse"] == pytest.approx(score["ape"]["translation_m"]["rmse"], abs=1e-8)


def test_all_pairs_and_an_offset_are_those_of_eval(slam, sequence, command_line, tmp_path):
    truth, (stamps, poses) = sequence / "groundtruth.txt", slam.trajectory()
    slam.save_trajectory(tmp_path / "trajectory.txt")
    command_line("eval", truth, tmp_path / "trajectory.txt", "--json", tmp_path / "score.json", "--rpe-delta", "3f",
                 "--rpe-all-pairs")
    score = dkb_slam.evaluate(truth, tmp_path / "trajectory.txt", rpe_delta="3f", rpe_all_pairs=True)
    assert score == json.loads((tmp_path / "score.json").read_text())
    assert score["rpe"]["pairs"] == 37
    late = dkb_slam.evaluate(truth, (stamps + 10**12, poses), time_offset=-1000)
    assert late["matched"] == 40
    # Motion capture writes nan where its markers are hidden.
    lines = truth.read_text().splitlines()
    lines[-1] = lines[-1].split()[0] + " nan" * 7
    (tmp_path / "hidden.txt").write_text("\n".join(lines) + "\n")
    assert dkb_slam.evaluate(tmp_path / "hidden.txt", (stamps, poses))["matched"] >= 39


def test_alignments_are_those_of_eval(slam, sequence, command_line, tmp_path):
    truth = sequence / "groundtruth.txt"
    slam.save_trajectory(tmp_path / "trajectory.txt")
    for align in ("se3", "sim3", "origin", "none"):
        command_line("eval", truth, tmp_path / "trajectory.txt", "--json", tmp_path / "score.json", "--align", align)
        score = dkb_slam.evaluate(truth, tmp_path / "trajectory.txt", align=align)
        assert score == json.loads((tmp_path / "score.json").read_text()) and score["align"] == align
    assert dkb_slam.evaluate(truth, slam, scale=True) == dkb_slam.evaluate(truth, slam, align="sim3", scale=True)
    with pytest.raises(dkb_slam.InputError, match='align: "se2" is none of se3, sim3, origin and none'):
        dkb_slam.evaluate(truth, slam, align="se2")
    with pytest.raises(dkb_slam.InputError, match="scale: align=.origin. does not scale"):
        dkb_slam.evaluate(truth, slam, align="origin", scale=True)


def test_an_estimate_without_a_pose_is_told_as_such(sequence):
    truth, source = sequence / "groundtruth.txt", dkb_slam.open(sequence)
    slam = dkb_slam.Slam(source.camera)
    with pytest.raises(dkb_slam.InputError, match=r"^estimate: it has no poses \(no frame was processed\)$"):
        dkb_slam.evaluate(truth, slam)
    slam.localize_only()
    for frame in source:
        slam.process(frame)
        if frame.index == 2:
            break
    for call in (lambda: dkb_slam.evaluate(truth, slam), slam.plot, lambda: slam.plot(truth)):
        with pytest.raises(dkb_slam.InputError, match=r"it has no poses \(none of its 3 frames was tracked\)$"):
            call()
    with pytest.raises(dkb_slam.InputError, match="^the estimate has no poses"):
        dkb_slam.evaluate(truth, (np.zeros(0, np.int64), np.zeros((0, 4, 4))))


def test_what_cannot_be_scored_is_one_line(slam, sequence):
    stamps, poses = slam.trajectory()
    with pytest.raises(dkb_slam.InputError, match="^0 of 40 estimated"):
        dkb_slam.evaluate(sequence / "groundtruth.txt", (stamps + 10**15, poses))
    with pytest.raises(dkb_slam.InputError, match="rpe-delta"):
        dkb_slam.evaluate(sequence / "groundtruth.txt", slam, rpe_delta="1x")
    with pytest.raises(dkb_slam.InputError, match="estimate 0: it is no rigid motion"):
        dkb_slam.evaluate(sequence / "groundtruth.txt", (stamps, np.zeros_like(poses)))
    with pytest.raises(dkb_slam.InputError, match="estimate: stamps_ns must rise, but element 1 "):
        dkb_slam.evaluate(sequence / "groundtruth.txt", (stamps[::-1], poses[::-1]))


def test_a_plot_is_a_picture_for_notebooks(slam, sequence, tmp_path):
    alone, beside = slam.plot(title="mine & yours"), slam.plot(sequence / "groundtruth.txt")
    for plot in (alone, beside, dkb_slam.plot_trajectory(sequence / "groundtruth.txt")):
        xml.dom.minidom.parseString(plot._repr_svg_())
    assert "mine &amp; yours" in alone.svg and "APE" in beside.svg and "APE" not in alone.svg
    alone.save(tmp_path / "path.svg")
    assert (tmp_path / "path.svg").read_text() == alone.svg
    with pytest.raises(dkb_slam.InputError, match="path.png: plots are SVG pictures; give a name that ends in .svg"):
        alone.save(tmp_path / "path.png")
    with pytest.raises(dkb_slam.InputError, match="path.svg"):
        alone.save(tmp_path / "nowhere" / "path.svg")
