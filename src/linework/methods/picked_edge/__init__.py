"""An edge picked at one pixel and followed through stereo pairs."""
