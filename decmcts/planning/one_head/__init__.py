"""One head: search, cooling, certificate, and no file that is slower than its source."""
