"""Images of a board of AprilTags: printing, rendering, detection and pose (extra ``images``)."""
