"""What the general search of `identify(image)` is trained on: markers in any light, and photographs without any."""
