"""``python -m tests.support.caller ADDRESSES`` calls a Dask scheduler at each of a JSON list.

It prints a line for each that there is none at: what was said, and seconds.
"""

import json
import sys
import time

from coartic import CoarticError
from coartic.benchmarks.cluster import Dask


def main():
    for address in json.loads(sys.argv[1]):
        clock = time.monotonic()
        try:
            list(Dask(address, scheduler_s=0.5).perform([{"run_id": "0"}]))
        except CoarticError as error:
            print(json.dumps([str(error), time.monotonic() - clock]), flush=True)


if __name__ == "__main__":
    main()
