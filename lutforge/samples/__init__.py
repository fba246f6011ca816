"""From shots to the sample table that every fit reads."""
