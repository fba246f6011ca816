"""Models of differences between shots of one camera: lens falloff, tone."""
