"""Parts of a sequence: what lies inside a window, and the best of several, window by window."""
