"""Errors of the command `galloping`: one line each, with an exit code."""

import signal
import sys
from contextlib import suppress

import click

from galloping.extras import missing_line

EXIT_INTERRUPTED = 130  # exit code after Ctrl-C


class FilledCommand(click.Command):
    """Click command that refuses empty texts, which would have no effect or name the folder."""

    def invoke(self, ctx: click.Context) -> object:
        """Run the command; raise BadParameter for an empty argument or option."""
        for parameter in self.params:
            given = ctx.params.get(parameter.name or "")
            if "" in (given if isinstance(given, tuple) else (given,)):
                raise click.BadParameter("must not be empty", ctx, parameter)
        return super().invoke(ctx)


class OneLineErrors(click.Group):
    """Click command group that prints input errors and interruptions as one line each."""

    command_class = FilledCommand

    def invoke(self, context: click.Context) -> object:
        """Run the command; exit with code 1 after an input error, 128 + signal after a signal."""
        with suppress(ValueError):  # not in the main thread
            # exit through `finally` blocks, so that no unfinished file remains
            signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
        try:
            return super().invoke(context)
        except (KeyboardInterrupt, SystemError) as error:
            cause = _find_interruption(error)
            if cause is None:
                raise
            if isinstance(cause, SystemExit):
                raise cause from None
            click.echo("Interrupted", err=True)
            context.exit(EXIT_INTERRUPTED)
        except ModuleNotFoundError as error:
            raise click.ClickException(missing_line(error)) from error
        except BrokenPipeError:
            raise  # the reader of the rows has closed the pipe
        except OSError as error:
            what = error.filename or (error.errno and "standard output")
            if what == "standard output":
                with suppress(OSError):  # otherwise its buffer raises again at exit
                    sys.stdout.close()
            text = f"{what}: {error.strerror}" if what else str(error)
            raise click.ClickException(_as_printable(text)) from error
        except ValueError as error:
            raise click.ClickException(_as_printable(str(error))) from error


def _as_printable(text: str) -> str:
    """Remove control characters of terminals from text, such as those in a file's name."""
    return "".join(c if c.isprintable() or c == "\n" else " " for c in text)


def _find_interruption(error: BaseException | None) -> KeyboardInterrupt | SystemExit | None:
    """Find what a signal raised: the error itself, or the cause that compiled code reports."""
    while error is not None and not isinstance(error, KeyboardInterrupt | SystemExit):
        error = error.__cause__
    return error
