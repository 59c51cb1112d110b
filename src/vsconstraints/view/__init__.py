"""A scene or a run to look at: preview, replay, film, images, notebooks."""
