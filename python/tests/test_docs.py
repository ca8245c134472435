# SPDX-License-Identifier: Apache-2.0
"""docs/python.md as its reader would try it: every block, in its order, in one session."""
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "python.md"


def test_the_page_works_as_printed(sequence, tmp_path, monkeypatch, capsys):
    (tmp_path / "sequence").symlink_to(sequence)
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    assert len(blocks) == 5
    session = {}
    for block in blocks:
        exec(block, session)
    assert session["poses"].shape == (40, 4, 4) and Path("trajectory.txt").exists()
    assert "initialising None" in capsys.readouterr().out
    assert session["score"]["ape"]["translation_m"]["rmse"] < 0.02


def test_the_readmes_block_is_complete(sequence):
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(encoding="utf-8"), re.M | re.S)
    assert len(blocks) == 1
    session = {}
    exec(blocks[0].replace("path/to/sequence", str(sequence)), session)
    assert session["poses"].shape == (40, 4, 4)
