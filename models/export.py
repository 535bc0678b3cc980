#!/usr/bin/env python3
"""Exports published enhancement models from their repositories to ONNX, each with a sidecar, and compares it with the original.

    pip install torch==2.15.0 onnx==1.23.2 onnxruntime==1.32.0 einops==0.8.2     # a GPU is not needed

    git clone https://github.com/Li-Chongyi/Zero-DCE            # CC BY-NC 4.0, weights in it
    git clone https://github.com/Li-Chongyi/Zero-DCE_extension  # CC BY-NC 4.0, weights in it
    git clone https://github.com/dut-media-lab/RUAS             # no licence stated, weights in it
    git clone https://github.com/vis-opt-group/SCI              # MIT, weights in it
    git clone https://github.com/zhenqifu/PairLIE               # no licence stated, weights in it
    git clone https://github.com/caiyuanhao1998/Retinexformer   # MIT, weights behind the links of its README
    git clone https://github.com/cidautai/DarkIR                # MIT, weights behind the links of its README

    python export.py zero-dce Zero-DCE Zero-DCE/Zero-DCE_code/snapshots/Epoch99.pth zerodce.onnx
    python export.py zero-dce++ Zero-DCE_extension Zero-DCE_extension/Zero-DCE++/snapshots_Zero_DCE++/Epoch99.pth zerodcepp.onnx
    python export.py ruas-lol RUAS RUAS/ckpt/lol.pt ruas_lol.onnx
    python export.py ruas-upe RUAS RUAS/ckpt/upe.pt ruas_upe.onnx
    python export.py sci SCI SCI/weights/medium.pt sci.onnx
    python export.py pairlie PairLIE PairLIE/weights/PairLIE.pth pairlie.onnx
    python export.py retinexformer Retinexformer LOL_v2_real.pth retinexformer.onnx
    python export.py darkir DarkIR DarkIR_1k.pt darkir_1280x720.onnx --size 1280x720

`darkqa-eval enhance presets` prints the command for each model, with its repository, commit and licence.

An export takes images of any size, or with `--size` of one. DarkIR needs `--size`, for its Fourier transforms become products with
fixed matrices: ONNX Runtime's own DFT is many times slower, and most exporters have none.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import importlib.util
import io
import math
import os
import pathlib
import pickle
import re
import subprocess
import sys
import types
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import onnx
import onnxruntime
import torch

# Largest accepted difference between export and original, in codes of 255. Rounding makes less than 0.001, and one wrong factor
# in a Fourier transform of DarkIR made 0.86.
MOST = 0.05
SIZES = [(96, 132), (75, 109)]  # heights and widths of the images of the comparison, rounded down to the model's multiple


class OneOutput(torch.nn.Module):
    """A model that gives its image alone."""

    def __init__(self, model: torch.nn.Module, image: Callable):
        super().__init__()
        self.model, self.image = model, image

    def forward(self, dark):
        return self.image(self.model(dark))


@dataclass(frozen=True)
class Published:
    """A published model: its repository, and what its authors do before and after it."""

    url: str
    commit: str  # that this script was tried with
    files: tuple[str, ...]  # of the repository, that are loaded
    build: Callable[..., torch.nn.Module]  # from the repository's folder, the file of weights, and the weights in it
    tile: str
    rounding: str
    multiple: int = 1
    pad: str = "reflect"
    any_size: bool = True

    def sidecar(self, any_size: bool) -> str:
        """The text of the sidecar. A multiple matters only to a graph that takes any size."""
        lines = ['range_in = "0..1"', 'range_out = "0..1"', f'rounding = "{self.rounding}"', f'tile = "{self.tile}"']
        if any_size and self.multiple > 1:
            lines += [f"multiple = {self.multiple}", f'pad = "{self.pad}"']
        return "\n".join(lines) + "\n"


def without_gpu() -> None:
    """Lets code that asks for CUDA run on the processor."""
    torch.load = functools.partial(torch.load, map_location="cpu")
    torch.Tensor.cuda = torch.nn.Module.cuda = lambda self, *_, **__: self


@contextlib.contextmanager
def working_in(repo: pathlib.Path) -> Iterator[None]:
    """Lets a repository's code find its files and modules as if it were started there, without leaving compiled files in it."""
    back, sys.dont_write_bytecode = os.getcwd(), True
    os.chdir(repo)
    sys.path.insert(0, str(repo))
    try:
        yield
    finally:
        sys.path.remove(str(repo))
        os.chdir(back)


def module(path: pathlib.Path, name: str = "published") -> types.ModuleType:
    """The Python file of a repository, without its package."""
    spec = importlib.util.spec_from_file_location(name, path)
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


def weights(path: pathlib.Path) -> dict[str, torch.Tensor]:
    """The weights in a file of weights or in a checkpoint of a training."""
    try:
        held = torch.load(path, weights_only=True)
    except (pickle.UnpicklingError, RuntimeError, EOFError) as error:
        raise ValueError("PyTorch reads no weights from it; files that could run code are not loaded") from error
    held = next((held[key] for key in ("params", "state_dict", "model_state_dict") if key in held), held)
    return {name.removeprefix("module."): value for name, value in held.items()}


def filled(net: torch.nn.Module, held: dict[str, torch.Tensor], unused: str = "$^") -> torch.nn.Module:
    """The network with these weights. Both must have the same names, but for those that match the pattern `unused`."""
    try:
        differing = net.load_state_dict(held, strict=False)
    except RuntimeError as error:
        raise ValueError(f"its weights are of another model: {error}") from error
    for what, names in (("lacks", differing.missing_keys), ("has too many weights:", differing.unexpected_keys)):
        names = [name for name in names if not re.search(unused, name)]
        if names:
            raise ValueError(f"its weights are of another model: it {what} {', '.join(names[:3])}{' …' if names[3:] else ''}")
    return net


def zero_dce(repo, _, held):
    net = module(repo / "Zero-DCE_code/model.py").enhance_net_nopool()
    return OneOutput(filled(net, held), lambda outputs: outputs[1])  # of x4, x8 and the curves: the image after all eight


def zero_dce_pp(repo, _, held):
    net = module(repo / "Zero-DCE++/model.py").enhance_net_nopool(scale_factor=12)  # as in its lowlight_test.py
    return OneOutput(filled(net, held), lambda outputs: outputs[0])  # of the image and the curves


def ruas(repo, _, held, image):
    net = module(repo / "model.py").Network()
    return OneOutput(filled(net, held), lambda outputs: outputs[0][image])  # of the images and the illuminations


def sci(repo, path, held):
    net = module(repo / "model.py").Finetunemodel(str(path))
    return OneOutput(filled(net, held, unused=r"^calibrate\."), lambda outputs: outputs[1])  # of the illumination and the image


def pairlie(repo, _, held, exponent):
    net = module(repo / "net/net.py").net()
    return OneOutput(filled(net, held), lambda outputs: outputs[0] ** exponent * outputs[1])  # of light, reflectance, denoised input


def retinexformer(repo, _, held):
    arch = module(repo / RETINEXFORMER)
    return filled(arch.RetinexFormer(n_feat=40, stage=1, num_blocks=[1, 2, 2]), held)  # as in all its Options/RetinexFormer_*.yml


def darkir(repo, _, held):
    # In place of the repository's package, whose `__init__` imports what only training needs.
    package = sys.modules["archs"] = types.ModuleType("archs")
    package.__path__ = [str(repo / "archs")]
    width = len(held.get("intro.weight", range(32)))  # 32 (m) or 64 (l)
    return filled(module(repo / "archs/DarkIR.py", "archs.DarkIR").DarkIR(width=width), held, unused=r"adapter|^side_out\.")


def stand_in(name: str, **contents) -> None:
    """A module in place of one that a repository imports, with the few things that its network uses of it."""
    parts = name.split(".")
    for length in range(1, len(parts) + 1):
        sys.modules.setdefault(".".join(parts[:length]), types.ModuleType(".".join(parts[:length])))
    vars(sys.modules[name]).update(contents)


def iat(repo, _, held):
    stand_in("imp")  # of Python before 3.12; imported, not used
    unused = {"VisionTransformer": object, "_cfg": dict}
    stand_in("timm.models.vision_transformer", **unused)
    stand_in("timm.models.registry", register_model=lambda model: model)
    layers = {"trunc_normal_": torch.nn.init.trunc_normal_, "to_2tuple": lambda side: (side, side)}
    stand_in("timm.models.layers", DropPath=lambda _: torch.nn.Identity(), **layers)  # paths are dropped in training alone
    sys.path.insert(0, str(repo / "IAT_enhance"))
    net = module(repo / "IAT_enhance/model/IAT_main.py").IAT()
    return OneOutput(filled(net, held), lambda outputs: outputs[2])  # of factor, summand and image


def uretinex(repo, path, _):
    stand_in("torchvision.transforms", Grayscale=object, ToTensor=object, Compose=lambda _: None)
    stand_in("PIL", Image=None)
    sys.modules["torchvision"].transforms = sys.modules["torchvision.transforms"]
    files = {"Decom_model_low_path": "init_low.pth", "unfolding_model_path": path.name, "adjust_model_path": "L_adjust.pth"}
    options = argparse.Namespace(ratio=5, **{option: str(path.with_name(file)) for option, file in files.items()})
    with contextlib.redirect_stdout(io.StringIO()):
        net = module(repo / "test.py").Inference(options)
    return OneOutput(net, lambda outputs: outputs[0])  # of image and seconds


def to_hvi(trans, rgb):
    """CIDNet's RGB_HVI.HVIT with choices by `where`, which are exported for any size; there they are assignments by masks."""
    red, green, blue = rgb[:, 0], rgb[:, 1], rgb[:, 2]
    value, least = rgb.max(1)[0], rgb.min(1)[0]
    span, none = value - least + 1e-8, torch.zeros_like(value)
    hue = torch.where(blue == value, 4 + (red - green) / span, none)
    hue = torch.where(green == value, 2 + (blue - red) / span, hue)
    hue = torch.where(red == value, ((green - blue) / span) % 6, hue)
    hue = torch.where(least == value, none, hue) / 6
    saturation = torch.where(value == 0, none, (value - least) / (value + 1e-8))
    trans.this_k = trans.density_k.item()
    pi = 3.141592653589793
    chroma = ((value * 0.5 * pi).sin() + 1e-8).pow(trans.density_k) * saturation
    return torch.stack([chroma * (2 * pi * hue).cos(), chroma * (2 * pi * hue).sin(), value], 1)


def from_hvi(trans, hvi):
    """CIDNet's RGB_HVI.PHVIT with choices by `where`."""
    value, pi = hvi[:, 2].clamp(0, 1), 3.141592653589793
    chroma = ((value * 0.5 * pi).sin() + 1e-8).pow(trans.this_k) + 1e-8
    across, up = ((hvi[:, place].clamp(-1, 1) / chroma).clamp(-1, 1) for place in (0, 1))
    hue = torch.atan2(up + 1e-8, across + 1e-8) / (2 * pi) % 1
    saturation = (torch.sqrt(across**2 + up**2 + 1e-8) * trans.alpha_s).clamp(0, 1)
    sector = torch.floor(hue * 6)
    part = hue * 6 - sector
    p, q, t = value * (1 - saturation), value * (1 - part * saturation), value * (1 - (1 - part) * saturation)
    sectors = [(value, t, p), (q, value, p), (p, value, t), (p, q, value), (t, p, value), (value, p, q)]
    colours = []
    for place in range(3):
        colour = torch.zeros_like(hue)
        for number, channels in enumerate(sectors):
            colour = torch.where(sector == number, channels[place], colour)
        colours.append(colour)
    return torch.stack(colours, 1) * trans.alpha


def cidnet(repo, _, held):
    stand_in("huggingface_hub", PyTorchModelHubMixin=type("PyTorchModelHubMixin", (), {}))
    net = filled(module(repo / "net/CIDNet.py").CIDNet(), held)
    net.trans.gated = net.trans.gated2 = True
    net.trans.alpha = net.trans.alpha_s = 1.0  # as by default in its eval_hf.py
    return net


def llformer(repo, _, held):
    arch = module(repo / "model/LLFormer.py").LLFormer
    return filled(arch(num_blocks=[2, 4, 8, 16], attention=True), held)  # as in its test.py


def restormer(repo, _, held):
    # Its demo.py takes norms without bias for the weights of denoising.
    has_bias = not held or any(name.endswith("norm1.body.bias") for name in held)
    arch = module(repo / RESTORMER).Restormer
    return filled(arch(LayerNorm_type="WithBias" if has_bias else "BiasFree"), held)


def mirnet(repo, _, held):
    return filled(module(repo / MIRNET).MIRNet_v2(), held)  # its defaults are those of Options/Enhancement_MIRNet_v2_*.yml


GITHUB = "https://github.com/"
RUAS = (GITHUB + "dut-media-lab/RUAS", "22b1cd6", ("model.py", "operations.py", "genotypes.py", "model/denoise.pt"))
PAIRLIE = (GITHUB + "zhenqifu/PairLIE", "3fd5c15", ("net/net.py",))
RETINEXFORMER = "basicsr/models/archs/RetinexFormer_arch.py"
RESTORMER = "basicsr/models/archs/restormer_arch.py"
MIRNET = "basicsr/models/archs/mirnet_v2_arch.py"
IAT = ("IAT_enhance/model/IAT_main.py", "IAT_enhance/model/blocks.py", "IAT_enhance/model/global_net.py")
CIDNET = ("net/CIDNet.py", "net/HVI_transform.py", "net/transformer_utils.py", "net/LCA.py")
DARKIR = ("archs/DarkIR.py", "archs/arch_model.py", "archs/arch_util.py")
MODELS = {
    # A convolution of 3 × 3 reaches 1 pixel: Zero-DCE has seven, SCI three, PairLIE ten. Each of RUAS's three cells reaches 3,
    # its denoiser 8. Each test script saves by `save_image`, `img_as_ubyte` (which round), or by `astype`, `ToPILImage` (which truncate).
    "zero-dce": Published(GITHUB + "Li-Chongyi/Zero-DCE", "e0f4adc", ("Zero-DCE_code/model.py",), zero_dce, "exact:8", "round"),
    "zero-dce++": Published(
        GITHUB + "Li-Chongyi/Zero-DCE_extension", "09f202b", ("Zero-DCE++/model.py",), zero_dce_pp, "none", "round", 12, "crop"
    ),
    "ruas-lol": Published(*RUAS, functools.partial(ruas, image=-1), "exact:17", "truncate"),
    "ruas-upe": Published(*RUAS, functools.partial(ruas, image=-2), "exact:9", "truncate"),
    "ruas-dark": Published(*RUAS, functools.partial(ruas, image=-2), "exact:9", "truncate"),
    "sci": Published(GITHUB + "vis-opt-group/SCI", "9d28a3f", ("model.py", "loss.py"), sci, "exact:8", "truncate"),
    "pairlie": Published(*PAIRLIE, functools.partial(pairlie, exponent=0.2), "exact:10", "truncate"),
    "pairlie-lol": Published(*PAIRLIE, functools.partial(pairlie, exponent=0.14), "exact:10", "truncate"),  # eval.py says so for LOL
    "retinexformer": Published(
        GITHUB + "caiyuanhao1998/Retinexformer", "ad5c091", (RETINEXFORMER,), retinexformer, "none", "round", 4, "reflect"
    ),
    "darkir": Published(GITHUB + "cidautai/DarkIR", "0910291", DARKIR, darkir, "none", "truncate", any_size=False),
    "iat": Published(GITHUB + "cuiziteng/Illumination-Adaptive-Transformer", "c764722", IAT, iat, "none", "round"),
    "uretinex": Published(
        GITHUB + "AndersonYong/URetinex-Net", "7ee2196", ("test.py", "utils.py", "network/decom.py"), uretinex, "none", "truncate"
    ),
    "cidnet": Published(GITHUB + "Fediory/HVI-CIDNet", "eb43d7d", CIDNET, cidnet, "none", "truncate", 8),
    "llformer": Published(GITHUB + "TaoWangzj/LLFormer", "ed5e7bf", ("model/LLFormer.py",), llformer, "none", "round", 16),
    "restormer": Published(GITHUB + "swz30/Restormer", "df766d5", (RESTORMER,), restormer, "none", "round", 8),
    "mirnet": Published(GITHUB + "swz30/MIRNetv2", "9014049", (MIRNET,), mirnet, "none", "round", 4),
}


def waves(rows: int, columns: int) -> list[torch.Tensor]:
    """cos and sin of 2π·row·column / rows, in double precision until the last."""
    angle = 2 * math.pi / rows * np.outer(np.arange(rows), np.arange(columns)) % (2 * math.pi)
    return [torch.from_numpy(wave.astype(np.float32)) for wave in (np.cos(angle), np.sin(angle))]


def frequencies_by_products(mlp, x):
    """DarkIR's FreMLP with its real Fourier transforms as products with matrices.

    The forward transform is X = (C − iS) x (C − iS), the inverse its conjugate over height · width, with every frequency of
    the half spectrum but the first and, of an even width, the last counted twice.
    """
    height, width = int(x.shape[-2]), int(x.shape[-1])
    half = width // 2 + 1
    down, across = waves(height, height), waves(width, half)
    a, b = x @ across[0], x @ across[1]
    real, imaginary = down[0] @ a - down[1] @ b, -(down[1] @ a + down[0] @ b)
    magnitude = torch.sqrt(real * real + imaginary * imaginary)
    some = magnitude > 0
    divisor = torch.where(some, magnitude, torch.ones_like(magnitude))
    cosine = torch.where(some, real / divisor, torch.ones_like(magnitude))
    sine = imaginary / divisor
    changed = mlp.process1(magnitude)
    real, imaginary = changed * cosine, changed * sine
    a = down[0] @ real - down[1] @ imaginary
    b = down[1] @ real + down[0] @ imaginary
    twice = torch.full((half, 1), 2.0)
    twice[0] = 1
    if width % 2 == 0:
        twice[-1] = 1
    scale = twice / (height * width)
    return a @ (scale * across[0].T) - b @ (scale * across[1].T)


def images(height: int, width: int) -> dict[str, torch.Tensor]:
    """A dark image, brighter to the right with noise, and one of random samples, both of whole codes of 255, by name."""
    noise, random = torch.rand(2, 1, 3, height, width, generator=torch.Generator().manual_seed(0))
    dark = 0.06 * torch.linspace(0, 1, width) + 0.06 * noise
    return {f"{name} {width}x{height}": torch.round(255 * image) / 255 for name, image in (("dark", dark), ("random", random))}


def exported(net: torch.nn.Module, example: torch.Tensor, any_size: bool) -> bytes:
    """The ONNX file of a network, for images of the example's size or of any."""
    axes = {name: {2: "height", 3: "width"} for name in ("input", "output")} if any_size else {}
    for part in net.modules():
        if type(part).__name__ == "FreMLP":
            type(part).forward = frequencies_by_products
        if type(part).__name__ == "RGB_HVI":
            type(part).HVIT, type(part).PHVIT = to_hvi, from_hvi
    file = io.BytesIO()
    with warnings.catch_warnings(), torch.no_grad():
        # They say that tracing may freeze a size, which the comparison at another size finds, and that this exporter is an old one.
        warnings.simplefilter("ignore")
        names = {"input_names": ["input"], "output_names": ["output"]}
        torch.onnx.export(net, (example,), file, **names, dynamic_axes=axes, opset_version=17, dynamo=False)
    return file.getvalue()


def origin(repo: pathlib.Path) -> dict[str, str]:
    """URL and commit of a checkout, for the model's metadata; "-dirty" where tracked files were changed, "unknown" where it is none."""

    def git(*words: str) -> str:
        with contextlib.suppress(OSError):
            return subprocess.run(["git", "-C", repo, *words], capture_output=True, text=True, check=False).stdout.strip()
        return ""

    # A folder in a checkout of something else is none of its own.
    top = git("rev-parse", "--show-toplevel")
    if not top or pathlib.Path(top).resolve() != repo:
        return {"source": "unknown", "commit": "unknown"}
    url = re.sub(r"//[^/@]*@", "//", git("config", "--get", "remote.origin.url"))  # without a password
    commit = git("describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    return {"source": url or "unknown", "commit": commit or "unknown"}


def compare(model: bytes, inputs: dict[str, torch.Tensor], wanted: dict[str, np.ndarray]) -> None:
    """Prints how far the export's images are from the original's; above `MOST` the program ends."""
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    for name, image in inputs.items():
        (given,) = session.run(["output"], {"input": image.numpy()})
        if given.shape != wanted[name].shape:
            sys.exit(f"{name}: the export gives {given.shape}, the original {wanted[name].shape}; nothing was written")
        difference = 255 * np.abs(given - wanted[name])
        print(f"{name}: at most {difference.max():.6f} of 255 from the original, {difference.mean():.6f} in the mean")
        if not difference.max() <= MOST:  # so is what is no number
            sys.exit("the export is not the model; nothing was written")


def size(text: str) -> tuple[int, int]:
    """Height and width of WIDTHxHEIGHT."""
    match = re.fullmatch(r"([1-9]\d*)x([1-9]\d*)", text)
    if not match:
        raise argparse.ArgumentTypeError(f"{text} is not WIDTHxHEIGHT, such as 1280x720")
    return int(match[2]), int(match[1])


def arguments() -> argparse.Namespace:
    """The command line; what is missing ends the program."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", choices=MODELS)
    parser.add_argument("repo", type=pathlib.Path, help="folder of the repository")
    parser.add_argument("weights", type=pathlib.Path, help="file of weights")
    parser.add_argument("out", type=pathlib.Path, help="ONNX file that is written, and its sidecar OUT.toml beside it")
    parser.add_argument("--size", type=size, help="WIDTHxHEIGHT of all images; default: any size")
    said = parser.parse_args()
    said.repo, said.weights = said.repo.resolve(), said.weights.resolve()
    model = MODELS[said.model]
    if said.size is None and not model.any_size:
        parser.error(f"{said.model} is exported for one size: give --size WIDTHxHEIGHT")
    if said.size and any(side % model.multiple for side in said.size):
        parser.error(f"{said.model} takes multiples of {model.multiple} pixels: give another --size")
    if not said.out.resolve().parent.is_dir():
        parser.error(f"{said.out} cannot be written: its folder is missing")
    for path in [*(said.repo / file for file in model.files), said.weights]:
        if not path.is_file():
            sys.exit(f"{path} is missing; {said.model} is exported from a clone of {model.url} (tried at commit {model.commit})")
    return said


def main() -> None:
    """Exports a model, and writes it only if it is like the original."""
    said = arguments()
    model, any_size = MODELS[said.model], said.size is None
    came = origin(said.repo)
    print(f"code: {came['source']}, commit {came['commit']}")
    if not came["commit"].startswith(model.commit) or came["commit"].endswith("-dirty"):
        print(f"this script was tried with {model.url} at commit {model.commit}", file=sys.stderr)
    without_gpu()
    torch.serialization.add_safe_globals([argparse.Namespace])  # options beside the weights of URetinex-Net
    try:
        with working_in(said.repo):
            net = model.build(said.repo, said.weights, weights(said.weights)).eval()
    except ValueError as error:
        sys.exit(f"{said.weights}: {error}")
    sizes = [[side - side % model.multiple for side in sides] for sides in SIZES] if any_size else [said.size]
    inputs = {name: image for sides in sizes for name, image in images(*sides).items()}
    with torch.no_grad():
        wanted = {name: net(image).numpy() for name, image in inputs.items()}
    graph = onnx.load_from_string(exported(net, next(iter(inputs.values())), any_size))
    onnx.helper.set_model_props(graph, came)
    onnx.checker.check_model(graph)
    compare(graph.SerializeToString(), inputs, wanted)
    onnx.save(graph, said.out)
    sidecar = said.out.with_name(said.out.name + ".toml")
    sidecar.write_text(model.sidecar(any_size), encoding="utf-8")
    print(f"{said.out}, {sidecar.name}")


if __name__ == "__main__":
    main()
