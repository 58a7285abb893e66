"""The command `galloping`, also as `python -m galloping`."""

import sys

from galloping.extras import missing_line


def main() -> None:
    """Run the command `galloping`; exit with a message if a required package is missing."""
    try:
        from galloping.cli import main as command
    except ModuleNotFoundError as error:
        sys.exit(f"Error: {missing_line(error)}")
    command(prog_name="galloping")


if __name__ == "__main__":
    main()
