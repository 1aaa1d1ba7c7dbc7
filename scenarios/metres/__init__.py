"""Parts of the hundred ideal metres."""
