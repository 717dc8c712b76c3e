"""The film: the one integral over the tool path, live and offline, and its statistics."""
