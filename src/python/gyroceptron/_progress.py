"""A progress bar for terminals and notebooks."""


class ProgressBar:
    """A ``callback`` for :func:`train` and :func:`run` that shows bars of tqdm, in a terminal or a notebook.

    Options are those of ``tqdm.auto.tqdm``.
    """

    def __init__(self, **options):
        # Of the kind that suits where it is shown.
        from tqdm.auto import tqdm

        self._tqdm, self._options = tqdm, options
        self._bar = self._name = None

    def __call__(self, name, iteration, loss, validation):
        if name != self._name:
            self.close()
            self._name = name
            self._bar = self._tqdm(desc=name, unit="", **self._options)
        if iteration is not None:
            errors = {"loss": f"{loss:.2e}"}
            if validation is not None:
                errors["held out"] = f"{validation:.2e}"
            self._bar.set_postfix(errors, refresh=False)
            self._bar.update(iteration - self._bar.n)

    def close(self):
        """Ends the bar that is shown."""
        if self._bar is not None:
            self._bar.close()
        self._bar = self._name = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()
