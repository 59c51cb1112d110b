"""``{gallery}``: all shipped scenarios, each with a picture drawn when the page is read.

With the extra ``replay``, the scenarios named by the option ``replays`` also have a replay of some
laws.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from vsconstraints.controllers import make_controller
from vsconstraints.scenarios import Scenario, shipped_scenarios
from vsconstraints.simulation import simulate
from vsconstraints.view.preview import FIGURE, Preview

LAWS = ("tracking", "sliding-mode")
"""Laws in a replay."""

TEXT = """\
## {title}

`{name}`: {description}

![Start and goals of {name}: what the camera sees, the arm, and the rows that are \
near](_gallery/{name}.png)
"""


class Gallery(SphinxDirective):
    """One section for each scenario: title, description, picture, and a replay if there is one."""

    option_spec = {"replays": directives.unchanged}  # noqa: RUF012 - as Sphinx wants it

    def run(self) -> list[nodes.Node]:
        """Draw the pictures below the documentation's folder, and write the sections."""
        pictures = Path(self.env.srcdir) / "_gallery"
        pictures.mkdir(exist_ok=True)
        wanted = self.options.get("replays", "").split() if find_spec("viser") else ()
        parts = []
        for scenario in map(Scenario.load, shipped_scenarios()):
            FIGURE.write(pictures / f"{scenario.name}.png", Preview.of_scenario(scenario))
            description = " ".join(str(scenario.tables.get("description", "")).split())
            parts.append(
                TEXT.format(title=scenario.title, name=scenario.name, description=description)
            )
            if scenario.name in wanted:
                write_replay(scenario, pictures / f"{scenario.name}.html")
                link = f"{{download}}`{' and '.join(LAWS)} <_gallery/{scenario.name}.html>`"
                parts.append(f"[Replay](replay.md) of {link}.\n")
        return self.parse_text_to_nodes("\n".join(parts), allow_section_headings=True)


def write_replay(scenario: Scenario, path: Path) -> None:
    """Simulate a scenario with the laws, and write the replay for a browser."""
    from vsconstraints.view.replay import ReplayRun, write_replay

    setup = scenario.setup()
    write_replay(
        [ReplayRun(law, setup, simulate(setup, make_controller(law))) for law in LAWS], path
    )


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("gallery", Gallery)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
