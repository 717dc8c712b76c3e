"""Pictures for paper and web, drawn with matplotlib."""
