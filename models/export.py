#!/usr/bin/env python3
"""Exports the official weights of four enhancement models to ONNX, with a sidecar, and checks the export against the original.

    git clone https://github.com/Li-Chongyi/Zero-DCE           # CC BY-NC 4.0, weights in it
    git clone https://github.com/dut-media-lab/RUAS            # no licence stated, weights in it
    git clone https://github.com/caiyuanhao1998/Retinexformer  # MIT, weights behind the links of its README
    git clone https://github.com/cidautai/DarkIR               # MIT, weights behind the links of its README
    pip install torch onnx onnxruntime einops huggingface_hub

    python export.py zero-dce      Zero-DCE      Zero-DCE/Zero-DCE_code/snapshots/Epoch99.pth  zerodce.onnx
    python export.py ruas-lol      RUAS          RUAS/ckpt/lol.pt                              ruas_lol.onnx
    python export.py ruas-upe      RUAS          RUAS/ckpt/upe.pt                              ruas_upe.onnx
    python export.py retinexformer Retinexformer LOL_v2_real.pth                               retinexformer.onnx
    python export.py darkir        DarkIR        DarkIR_1k.pt                                  darkir_1280x720.onnx --size 1280x720

Zero-DCE, RUAS and RetinexFormer take images of any size; DarkIR those of one, for its Fourier transforms become products with
fixed matrices: ONNX Runtime's own DFT is many times slower, and most exporters have none.
"""

import argparse
import importlib.util
import math
import os
import pathlib
import sys

import numpy as np
import torch

SIDECARS = {
    "zero-dce": 'tile = "exact:8"\n',
    "ruas-lol": 'rounding = "truncate"\ntile = "exact:8"\n',
    "ruas-upe": 'rounding = "truncate"\ntile = "exact:8"\n',
    "retinexformer": 'multiple = 4\npad = "reflect"\ntile = "none"\n',
    "darkir": 'rounding = "truncate"\ntile = "none"\n',
}


class OneOutput(torch.nn.Module):
    """A model that gives its image alone."""

    def __init__(self, model, image):
        super().__init__()
        self.model, self.image = model, image

    def forward(self, dark):
        return self.image(self.model(dark))


def module(path, name):
    """The Python file of a repository, without its package."""
    spec = importlib.util.spec_from_file_location(name, path)
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


def weights(path, *keys):
    """The weights in a file, below the first of these keys that it has."""
    loaded = torch.load(path, map_location="cpu", weights_only=True)
    for key in keys:
        if key in loaded:
            loaded = loaded[key]
            break
    return {name.removeprefix("module."): value for name, value in loaded.items()}


def zero_dce(repo, path):
    net = module(repo / "Zero-DCE_code" / "model.py", "zero_dce").enhance_net_nopool()
    net.load_state_dict(weights(path))
    return OneOutput(net, lambda outputs: outputs[1])  # of x4, x8 and the curves: the image after all eight


def ruas(repo, path, index):
    # Its constructor loads a file by a relative path and asks for CUDA.
    if not torch.cuda.is_available():
        torch.Tensor.cuda = torch.nn.Module.cuda = lambda self, *_, **__: self
    back = os.getcwd()
    path = path.resolve()
    os.chdir(repo)
    sys.path.insert(0, str(pathlib.Path.cwd()))
    try:
        from model import Network

        net = Network()
    finally:
        os.chdir(back)
    net.load_state_dict(weights(path))
    return OneOutput(net, lambda outputs: outputs[0][index])  # of the images and the illuminations


def retinexformer(repo, path):
    arch = module(repo / "basicsr/models/archs/RetinexFormer_arch.py", "retinexformer")
    net = arch.RetinexFormer(in_channels=3, out_channels=3, n_feat=40, stage=1, num_blocks=[1, 2, 2])
    net.load_state_dict(weights(path, "params", "state_dict"))
    return net


def darkir(repo, path):
    sys.path[:0] = [str(repo), str(repo / "archs")]
    from archs.DarkIR import DarkIR

    held = weights(path, "params", "model_state_dict")
    net = DarkIR(width=held["intro.weight"].shape[0])  # 32 (m) or 64 (l)
    net.load_state_dict(held, strict=False)
    missing = [name for name in net.state_dict() if name not in held and "adapter" not in name and "side_out" not in name]
    if missing:
        sys.exit(f"{path} has no {', '.join(missing)}")
    return net


def waves(rows, columns):
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


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", choices=SIDECARS)
    parser.add_argument("repo", type=pathlib.Path)
    parser.add_argument("weights", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--size", default="640x360", help="WIDTHxHEIGHT, of DarkIR; default: 640x360")
    said = parser.parse_args()
    width, height = map(int, said.size.split("x"))
    repo = said.repo.resolve()
    net = {
        "zero-dce": lambda: zero_dce(repo, said.weights),
        "ruas-lol": lambda: ruas(repo, said.weights, -1),
        "ruas-upe": lambda: ruas(repo, said.weights, -2),
        "retinexformer": lambda: retinexformer(repo, said.weights),
        "darkir": lambda: darkir(repo, said.weights),
    }[said.model]()
    net.eval()
    fixed = said.model == "darkir"
    sizes = [(height, width)] if fixed else [(96, 128), (64, 72)]
    generator = torch.Generator().manual_seed(0)
    images = [0.3 * torch.rand(1, 3, *size, generator=generator) for size in sizes]
    with torch.no_grad():
        expected = [net(image).numpy() for image in images]
        if fixed:
            mlps = {type(part) for part in net.modules() if type(part).__name__ == "FreMLP"}
            for mlp in mlps:
                mlp.forward = frequencies_by_products
        axes = {} if fixed else {name: {2: "height", 3: "width"} for name in ("input", "output")}
        torch.onnx.export(
            net,
            (images[0],),
            str(said.out),
            input_names=["input"],
            output_names=["output"],
            dynamic_axes=axes,
            opset_version=17,
            dynamo=False,
        )
    said.out.with_name(said.out.name + ".toml").write_text(SIDECARS[said.model])

    import onnxruntime

    session = onnxruntime.InferenceSession(str(said.out), providers=["CPUExecutionProvider"])
    worst = 0.0
    for image, wanted in zip(images, expected):
        (given,) = session.run(["output"], {"input": image.numpy()})
        worst = max(worst, float(np.abs(given - wanted).max()))
    print(f"{said.out}: at most {255 * worst:.6f} of 255 from the original")
    if worst * 255 > 0.05:
        sys.exit("the export is not the model")


if __name__ == "__main__":
    main()
