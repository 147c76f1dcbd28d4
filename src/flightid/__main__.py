"""The command line as ``python -m flightid``, where the script ``flightid`` is not on the path."""

from flightid.cli import main

if __name__ == "__main__":
    main()
