"""The page about profiles: its commands print what it says, its table is what the files have."""

import re
import shlex

from project import ROOT
from rmrc.scenario.profile import SHIPPED, load_profile

PAGE = (ROOT / "docs/profiles.md").read_text("utf-8")


def row(name):
    profile = load_profile(name)

    def each(part):
        values = list(dict.fromkeys(part.value)) if part else []
        return ", ".join(f"{value:.4g}" for value in values) or "-"

    period = f"{profile.period.value:g}" if profile.period else "-"
    delay = " to ".join(f"{one:g}" for one in profile.loop.delay.value) if profile.loop.delay else "-"
    cells = [
        f"`{name}`",
        profile.robot,
        period,
        *map(each, (profile.rate, profile.acceleration, profile.jerk)),
        delay,
    ]
    return f"| {' | '.join(cells)} |"


def test_the_table_is_what_the_files_have():
    assert re.findall(r"^\| `\w+` \| [^|]+ \| [\d.-]+ \|.*\|$", PAGE, re.MULTILINE) == [
        row(name) for name in SHIPPED
    ]


def test_the_commands_print_what_the_page_says(rmrc):
    blocks = re.findall(r"^```sh\n(.*?)\n```\n\n```\n(.*?)\n```$", PAGE, re.MULTILINE | re.DOTALL)
    codes = []
    for command, line in blocks:
        code, out, err = rmrc(*shlex.split(command)[1:])
        codes.append(code)
        # how many commands of a run through a singularity are refused depends on the last digits of sines
        printed, told = (
            re.sub(r"got [1-9]\d* of", "got … of", " ".join(text.split())) for text in (out + err, line)
        )
        assert told in printed
    assert codes == [1, 0]
