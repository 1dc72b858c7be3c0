"""A folder of bags as demonstrations of the library."""

from msrd_ros.core.resources import shipped_bags
from msrd_ros.recordings.demonstrations import demonstrations

# Any folder of bags will do: these are the strokes that ship with the package.
found = demonstrations(shipped_bags(), robot="sawyer", labels=["forehand-push", "backhand-slice"])
print(found.layout.labels, "as", found.observations.shape, found.actions.shape)
print("columns:", ", ".join(found.layout.observation_names))
