"""What learned rewards say of recorded strokes: numbers, a picture and the command `explain`."""
