#!/usr/bin/env python3
"""Trains lift.onnx, the enhancer of this folder, on the built-in rooms and the project's own synthesis.

    pip install torch onnx onnxruntime numpy pillow
    python models/train.py --program target/release/darkqa-eval --work /some/folder

The program makes the data: rooms of seed 1001 to learn from, of seed 2002 to be measured by, each at all levels in both
variants. Training takes minutes on two cores. What comes out are models/lift.onnx and, on standard output, the mean PSNR
before and after by level on the rooms that it has not learned from.
"""

import argparse
import json
import math
import pathlib
import random
import subprocess

import numpy as np
import onnxruntime
import torch
from PIL import Image
from torch import nn

LEVELS = [f"L{level}-{variant}" for level in range(1, 6) for variant in ("ev", "noise")]


class Lift(nn.Module):
    """One gain and one curve for the whole image, then a small residual network that smooths noise.

    Gain and curve are two numbers from the image's mean light and the mean of its square root; the residual works on
    4 x 4 blocks of the brightened image and is told how much light was missing.
    """

    def __init__(self, width=48, depth=4):
        super().__init__()
        self.curve = nn.Sequential(nn.Linear(2, 16), nn.Tanh(), nn.Linear(16, 2))
        layers = [nn.Conv2d(49, width, 1), nn.ReLU()]
        for _ in range(depth):
            # A mask for each channel, then a mix of them (MobileNet, Howard et al., 2017).
            layers += [nn.Conv2d(width, width, 3, padding=1, groups=width), nn.Conv2d(width, width, 1), nn.ReLU()]
        self.smooth = nn.Sequential(*layers, nn.Conv2d(width, 48, 1))
        nn.init.zeros_(self.smooth[-1].weight)
        nn.init.zeros_(self.smooth[-1].bias)

    def forward(self, image):
        light = torch.pow(image.clamp(min=1e-5), 2.2)
        mean = light.mean(dim=(1, 2, 3), keepdim=True).clamp(min=1e-7)
        root = light.sqrt().mean(dim=(1, 2, 3), keepdim=True).clamp(min=1e-4)
        missing = torch.log2(0.35 / mean)
        told = torch.cat([missing, torch.log2(0.6 / root)], dim=1).flatten(1) / 6.0
        gain, gamma = self.curve(told).unsqueeze(-1).unsqueeze(-1).split(1, dim=1)
        lifted = (light * torch.exp(math.log(2.0) * (missing + gain))).clamp(1e-5, 1.0)
        lifted = torch.pow(lifted, torch.exp(math.log(2.0) * (gamma - 1.14)))
        blocks = nn.functional.pixel_unshuffle(lifted, 4)
        level = (missing / 6.0).expand(-1, 1, blocks.shape[2], blocks.shape[3])
        residual = nn.functional.pixel_shuffle(self.smooth(torch.cat([blocks, level], 1)), 4)
        return (lifted + residual).clamp(0.0, 1.0)


def read(path):
    return np.asarray(Image.open(path).convert("RGB"))


def pairs(program, work, seed, frames):
    """Makes rooms and their dark versions where they are not there yet; the paths of dark and lit images by level."""
    lit, dark = work / f"rooms-{seed}", work / f"dark-{seed}"
    if not (lit / "frames.jsonl").exists():
        rooms = ["rooms", "--out", lit, "--frames", str(frames), "--seed", str(seed), "--size", "320x240", "--force"]
        subprocess.run([program, *rooms], check=True)
    subprocess.run([program, "synthesize", lit, "--out", dark], check=True)
    found = {}
    for line in (lit / "frames.jsonl").read_text().splitlines():
        frame = json.loads(line)
        for level in LEVELS:
            image = dark / frame["scene"] / f"{frame['frame']}_{level}.png"
            found.setdefault(level, []).append((image, lit / frame["rgb"]))
    return found


def tensor(images):
    return torch.from_numpy(np.stack(images)).permute(0, 3, 1, 2).float() / 255.0


def edges(image):
    return image[..., 1:, :] - image[..., :-1, :], image[..., :, 1:] - image[..., :, :-1]


def loss(made, lit):
    """The mean absolute difference, of pixels and half as much of steps between neighbours."""
    steps = sum((a - b).abs().mean() for a, b in zip(edges(made), edges(lit)))
    return (made - lit).abs().mean() + 0.5 * steps


def psnr(a, b):
    return 10 * math.log10(255**2 / max(np.mean((a.astype(float) - b.astype(float)) ** 2), 1e-9))


def train(found, steps, batch):
    torch.manual_seed(0)
    choose = random.Random(0)
    memory = {path: read(path) for level in found.values() for pair in level for path in pair}
    lit = sorted({pair[1] for level in found.values() for pair in level})
    model = Lift()
    optimiser = torch.optim.Adam(model.parameters(), lr=2e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    for step in range(steps):
        # Every eighth image is well lit and must stay as it is.
        chosen = [
            (path, path)
            if choose.random() < 0.125 and (path := choose.choice(lit))
            else choose.choice(found[choose.choice(LEVELS)])
            for _ in range(batch)
        ]
        dark, clean = (tensor([memory[pair[side]] for pair in chosen]) for side in (0, 1))
        if choose.random() < 0.5:
            dark, clean = dark.flip(3), clean.flip(3)
        value = loss(model(dark), clean)
        optimiser.zero_grad()
        value.backward()
        nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimiser.step()
        schedule.step()
        if step % 200 == 0:
            print(f"step {step}: loss {value.item():.4f}", flush=True)
    return model.eval()


def export(model, path):
    names = {0: "batch", 2: "height", 3: "width"}
    torch.onnx.export(
        model,
        (torch.rand(1, 3, 240, 320),),
        str(path),
        input_names=["input"],
        output_names=["enhanced"],
        dynamic_axes={"input": names, "enhanced": names},
        opset_version=17,
        dynamo=False,
    )


def measure(path, found):
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])

    def mend(image):
        (made,) = session.run(None, {"input": tensor([image]).numpy()})
        return np.rint(made[0].transpose(1, 2, 0) * 255).clip(0, 255).astype(np.uint8)

    print("| level | dark | mended | gain |\n|---|---|---|---|")
    for level in LEVELS:
        before, after = [], []
        for dark, lit in found[level]:
            dark, lit = read(dark), read(lit)
            before.append(psnr(dark, lit))
            after.append(psnr(mend(dark), lit))
        before, after = np.mean(before), np.mean(after)
        print(f"| {level} | {before:.2f} | {after:.2f} | {after - before:+.2f} |")
    untouched = [psnr(mend(read(lit)), read(lit)) for _, lit in found[LEVELS[0]]]
    print(f"L0, mended though it is lit: {np.mean(untouched):.2f} dB")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="darkqa-eval")
    parser.add_argument("--work", type=pathlib.Path, required=True)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path(__file__).with_name("lift.onnx"))
    parser.add_argument("--frames", type=int, default=240)
    parser.add_argument("--steps", type=int, default=6000)
    parser.add_argument("--batch", type=int, default=4)
    said = parser.parse_args()
    learned = pairs(said.program, said.work, 1001, said.frames)
    held_out = pairs(said.program, said.work, 2002, 48)
    export(train(learned, said.steps, said.batch), said.out)
    print(f"{said.out}: {said.out.stat().st_size} bytes")
    measure(said.out, held_out)


if __name__ == "__main__":
    main()
