"""``darkqa-eval`` measures how well vision-language models see in the dark.

The program does the work. This package finds it (:func:`find_darkqa_bin`), starts it (:func:`run`, ``python -m darkqa_eval``)
and reads its runs into pandas (:func:`load_run`). Importing it loads neither pandas nor ONNX Runtime.
"""

from ._find import find_darkqa_bin, run
from ._load import load_run

__all__ = ["find_darkqa_bin", "load_run", "run"]
