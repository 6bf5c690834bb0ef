"""From moves to a print: contours, epochs, habits, and the text between them."""
