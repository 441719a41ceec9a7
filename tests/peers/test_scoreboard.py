"""Each peer of benchmarks/peers.py drives an arm, and what it is told is what it needs; `.ci/run peers` installs them."""

import dataclasses
import sys

import pytest

from project import ROOT

sys.path.insert(0, str(ROOT / "benchmarks"))

import peer_cases

import peers

TICKS = 300


@pytest.mark.filterwarnings("ignore")  # theirs
@pytest.mark.parametrize("name", [peer.name for _, peer in peers.peers()])
def test_a_loop_follows_a_path_far_from_singularities(name):
    """By the first setting of its grid, K = 10 /s, or as documented; who has no feed-forward lags by v/K."""
    package, peer = next((package, peer) for package, peer in peers.peers() if peer.name == name)
    if not peers.installed(package):
        pytest.skip(f"{package} is not installed; `.ci/run peers` installs it")
    arm = peer_cases.arm(peer_cases.FILES["UR5e"], peer_cases.RATES["UR5e"])
    far = peer_cases.Case("far", "", arm, peer_cases.HOMES["UR5e"], peer_cases.line([0, 0.2, 0.05]), 2.0)
    short = dataclasses.replace(far)
    vars(short).update(poses=far.poses[: TICKS + 1], twists=far.twists[:TICKS])  # the first of its ticks
    setting = peer.settings[0]
    figures = peers.run(short, peer, setting)
    assert isinstance(figures, dict), figures
    assert figures["rate over"] < 1e-9 and figures["over"] == 0
    gain = {"mjctrl as written": 9.5}.get(name, 10.0 if "gain" in setting else 1.0)
    lags = name.startswith(("mjctrl", "Toolbox as", "NEO as", "mink", "pink")) and not name.startswith(
        ("mink as", "pink as")
    )
    speed = max(abs(far.twists[:TICKS, 1])) if lags else 0.0
    assert figures["mm"] < 1e3 * speed / gain + 1.0
