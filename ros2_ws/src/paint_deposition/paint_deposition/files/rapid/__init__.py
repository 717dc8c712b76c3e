"""ABB RAPID modules: read as moves of the TCP, and written from planned passes."""
