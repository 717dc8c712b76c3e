"""Film and residual as colours: in files, viewers and pictures alike."""
