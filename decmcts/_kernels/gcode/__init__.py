"""Reading lines of G-code, moves and contours."""
