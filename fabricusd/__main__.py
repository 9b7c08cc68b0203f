"""`python -m fabricusd`."""

from fabricusd.cli.main import main

if __name__ == "__main__":
    raise SystemExit(main())
