"""Everything that starts, stops, watches or reproduces.  May import every other package."""

import os

# Many processes share few cores, and our linear systems are small: threads of the numerical
# library only get in each other's way (20 times slower).  Agents that we start inherit it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
