"""What agents say to each other: kinds of messages, their bytes, and the keys they go under."""
