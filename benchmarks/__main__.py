"""python -m benchmarks COMMAND."""

from .commands import app

if __name__ == "__main__":
    app()
