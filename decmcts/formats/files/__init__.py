"""What all files share: how large they may be, how they are read, and put in place whole."""
