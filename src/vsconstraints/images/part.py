"""Registration of rendered images as a type of sensor."""

from ..plugins.registry import Part

PART = Part(scenario_tables={"sensor": {"images": "vsconstraints.images.settings:ImageSettings"}})
