"""``python -m naisr_viewer`` is ``naisr-viewer``."""

import sys

from naisr_viewer.app import main

if __name__ == "__main__":
    sys.exit(main())
