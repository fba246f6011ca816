"""What differs from shot to shot of one camera."""
