"""The road room: from pixels to metres, km/h and lanes, each with its uncertainty."""
