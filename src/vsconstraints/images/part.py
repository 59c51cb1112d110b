"""What rendered images add to the core."""

from ..plugins.registry import Part

PART = Part(scenario_tables={"sensor": {"images": "vsconstraints.images.settings:ImageSettings"}})
