"""The exact inverse of a baked render: which scene the camera makes a JPEG colour of."""
