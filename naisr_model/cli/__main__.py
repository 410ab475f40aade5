"""``python -m naisr_model.cli`` is ``naisr``."""

import sys

from naisr_model.cli import main

sys.exit(main())
