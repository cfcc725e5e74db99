"""Points at an address: over HTTP and in object storage, read by ranges."""
