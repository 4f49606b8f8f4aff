"""How far markers are detected: scale, rotation, tilt, noise, blur, compression, light."""
