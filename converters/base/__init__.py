"""What every part of the converter uses: options, caches, names, file access, process pool."""
