#!/usr/bin/env python3
"""Trains room-net.onnx, the built-in model that answers from the pixels, on the built-in rooms as they are drawn: well lit.

    pip install torch onnx onnxruntime numpy pillow
    python models/train_room_net.py --program target/release/darkqa-eval --work /some/folder

The program draws the rooms: 1,600 frames of seeds 4001 to 4004 to learn from, 200 of seed 5001 to be measured by. No image is
darkened, no noise is added, and the network does not adapt to the light of an image: it learns from well-lit rooms alone, and
nothing here was chosen by its answers in the dark. Training takes about ten minutes on a free core with bfloat16. It draws its
random numbers from seed 0, but sums differ with the number of threads, so that other machines give other weights. What comes
out are models/room-net.onnx and, on standard output, the share of pixels and rooms that it reads correctly.
"""

import argparse
import json
import pathlib
import random
import subprocess

import numpy as np
import onnx
import onnxruntime
import torch
from PIL import Image
from torch import nn

WIDTH, HEIGHT = 192, 144
LEARNED, HELD_OUT = {4001: 400, 4002: 400, 4003: 400, 4004: 400}, {5001: 200}  # frames by seed
# The numbers of mpcat40 without those that the rooms do not have: stairs, column, beam, railing, gym equipment, seating, panel.
CLASSES = [n for n in range(1, 41) if n not in (16, 24, 29, 30, 33, 34, 35)]
NONE = -100  # pixels without a class
ROOMS = ["bedroom", "bathroom", "kitchen", "living room", "dining room", "office"]
NEAREST = 0.2  # metres


def layer(inputs, outputs, size=3, stride=1):
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False), nn.BatchNorm2d(outputs), nn.ReLU()
    )


class Residual(nn.Module):
    """Two layers whose result is added to their input (He et al., 2016)."""

    def __init__(self, width):
        super().__init__()
        self.layers = nn.Sequential(layer(width, width), layer(width, width))

    def forward(self, x):
        return x + self.layers(x)


class RoomNet(nn.Module):
    """Class and distance of each pixel, and the type of the room: a U-Net (Ronneberger et al., 2015) on blocks of 4 x 4 pixels.

    Nothing in it adapts to the light of an image.
    """

    def __init__(self, near=64, middle=96, far=128):
        super().__init__()
        self.near = nn.Sequential(layer(48, near), layer(near, near))
        self.middle = nn.Sequential(layer(near, middle, stride=2), Residual(middle))
        self.far = nn.Sequential(layer(middle, far, stride=2), Residual(far))
        self.whole = nn.Linear(far, far)
        self.room = nn.Sequential(nn.Dropout(0.2), nn.Linear(far, len(ROOMS)))
        self.to_middle, self.up_middle = layer(far, middle, 1), layer(middle, middle)
        self.to_near, self.up_near = layer(middle, near, 1), layer(near, near)
        self.pixels = nn.Conv2d(near, 4 * (len(CLASSES) + 1), 1)

    def forward(self, image):
        near = self.near(nn.functional.pixel_unshuffle(image, 4))
        middle = self.middle(near)
        far = self.far(middle)
        mean = far.mean((2, 3))
        x = far + self.whole(mean)[:, :, None, None]
        x = self.up_middle(middle + nn.functional.interpolate(self.to_middle(x), scale_factor=2.0, mode="bilinear"))
        x = self.up_near(near + nn.functional.interpolate(self.to_near(x), scale_factor=2.0, mode="bilinear"))
        pixels = nn.functional.pixel_shuffle(self.pixels(x), 2)
        return pixels[:, :-1], pixels[:, -1], self.room(mean)


class Exported(nn.Module):
    """What the program reads: the class and the distance in metres of each pixel, and the share of each room type."""

    def __init__(self, net):
        super().__init__()
        self.net = net
        self.register_buffer("numbers", torch.tensor(CLASSES, dtype=torch.int32))

    def forward(self, image):
        classes, distance, rooms = self.net(image)
        pixels = torch.cat([classes, distance[:, None]], 1)
        pixels = nn.functional.interpolate(pixels, scale_factor=2.0, mode="bilinear")
        return self.numbers[pixels[:, :-1].argmax(1)].float(), pixels[:, -1].exp(), rooms.softmax(1)


def draw(program, work, seed, frames):
    """Draws the rooms of a seed if they are not there yet; the folder."""
    folder = work / f"rooms-{seed}"
    if not (folder / "frames.jsonl").exists():
        size = f"{WIDTH}x{HEIGHT}"
        flags = ["--out", folder, "--frames", str(frames), "--seed", str(seed), "--size", size, "--force"]
        subprocess.run([program, "rooms", *flags], check=True)
    return folder


INDEX = np.full(42, NONE, np.int64)
INDEX[CLASSES] = np.arange(len(CLASSES))


def read(folder):
    """The images, classes, distances along the ray in metres and room types of a folder of rooms."""
    images, classes, distances, rooms = [], [], [], []
    columns, rows = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    for line in (folder / "frames.jsonl").read_text().splitlines():
        frame = json.loads(line)
        camera = frame["intrinsics"]
        x = (columns - camera["cx"]) / camera["fx"]
        y = (rows - camera["cy"]) / camera["fy"]
        depth = np.asarray(Image.open(folder / frame["depth"])).astype(np.float32) * frame["depth_scale"]
        images.append(np.asarray(Image.open(folder / frame["rgb"]).convert("RGB")))
        classes.append(INDEX[np.asarray(Image.open(folder / frame["sem"]))])
        distances.append((depth * np.sqrt(1 + x * x + y * y)).astype(np.float16))
        rooms.append(ROOMS.index(frame["room_gt"]))
    return [np.stack(values) for values in (images, classes, distances, rooms)]


def gather(program, work, seeds):
    parts = [read(draw(program, work, seed, frames)) for seed, frames in seeds.items()]
    return [np.concatenate(values) for values in zip(*parts)]


def weights(classes):
    """Rare classes count more: by the root of their share of the pixels, at most ten times as much as the commonest."""
    share = np.bincount(classes[classes != NONE], minlength=len(CLASSES)) / classes.size
    weight = 1 / np.sqrt(np.maximum(share, share.max() / 100))
    return torch.from_numpy(weight / weight.mean()).float()


def batches(data, size, choose):
    """All frames once, in another order; each mirrored or not, and in exchanged colours or not: things may have any colour."""
    images, classes, distances, rooms = data
    order = list(range(len(images)))
    choose.shuffle(order)
    for start in range(0, len(order) - size + 1, size):
        index = order[start : start + size]
        image = torch.from_numpy(images[index]).permute(0, 3, 1, 2).float() / 255.0
        label = torch.from_numpy(classes[index][:, 1::2, 1::2])
        distance = torch.from_numpy(distances[index][:, 1::2, 1::2]).float().clamp(min=NEAREST).log()
        for i in range(size):
            if choose.random() < 0.5:
                image[i], label[i], distance[i] = image[i].flip(2), label[i].flip(1), distance[i].flip(1)
            if choose.random() < 0.5:
                image[i] = image[i][choose.sample(range(3), 3)]
        yield image.contiguous(memory_format=torch.channels_last), label, distance, torch.from_numpy(rooms[index])


def train(data, epochs, size):
    torch.manual_seed(0)
    choose = random.Random(0)
    net = RoomNet().to(memory_format=torch.channels_last)
    weight = weights(data[1])
    steps = epochs * (len(data[0]) // size)
    optimiser = torch.optim.AdamW(net.parameters(), lr=3e-3, weight_decay=0.02)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 3e-3, steps, pct_start=0.1)
    for epoch in range(epochs):
        losses = []
        for image, label, distance, room in batches(data, size, choose):
            with torch.autocast("cpu", dtype=torch.bfloat16):
                kinds, far, types = net(image)
            value = (
                nn.functional.cross_entropy(kinds.float(), label, weight, ignore_index=NONE)
                + (far.float() - distance).abs().mean()
                + 0.3 * nn.functional.cross_entropy(types.float(), room)
            )
            optimiser.zero_grad()
            value.backward()
            nn.utils.clip_grad_norm_(net.parameters(), 1.0)
            optimiser.step()
            schedule.step()
            losses.append(value.item())
        print(f"epoch {epoch + 1} of {epochs}: loss {np.mean(losses):.4f}", flush=True)
    return net.eval()


def export(net, path):
    """Writes the network, its weights as bytes."""
    names = ["classes", "distance", "rooms"]
    image = torch.rand(1, 3, HEIGHT, WIDTH)
    torch.onnx.export(
        Exported(net), (image,), str(path), input_names=["image"], output_names=names, opset_version=17, dynamo=False
    )
    model = onnx.load(path)
    quantise(model.graph)
    onnx.checker.check_model(model)
    onnx.save(model, path)


def quantise(graph):
    """Stores the weights of filters in 8 bits, with a scale for each output; the runtime multiplies them out."""
    nodes = []
    for tensor in list(graph.initializer):
        values = onnx.numpy_helper.to_array(tensor)
        if values.dtype != np.float32 or values.ndim < 2:
            continue
        scale = np.abs(values).reshape(len(values), -1).max(1).clip(1e-12) / 127
        codes = np.rint(values / scale.reshape(-1, *[1] * (values.ndim - 1))).astype(np.int8)
        name, parts = tensor.name, (f"{tensor.name}_codes", f"{tensor.name}_scale", f"{tensor.name}_zero")
        graph.initializer.remove(tensor)
        for part, array in zip(parts, (codes, scale.astype(np.float32), np.zeros(len(values), np.int8))):
            graph.initializer.append(onnx.numpy_helper.from_array(array, part))
        nodes.append(onnx.helper.make_node("DequantizeLinear", parts, [name], axis=0))
    kept = nodes + list(graph.node)
    del graph.node[:]
    graph.node.extend(kept)


def measure(path, data):
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    images, classes, distances, rooms = data
    right = counted = found = 0
    far = []
    hits, union = np.zeros(len(CLASSES)), np.zeros(len(CLASSES))
    for image, label, distance, room in zip(images, classes, distances, rooms):
        kinds, away, shares = session.run(None, {"image": (image.transpose(2, 0, 1)[None] / 255.0).astype(np.float32)})
        kinds, known = INDEX[kinds[0].astype(int)], label != NONE
        right += (kinds == label)[known].sum()
        counted += known.sum()
        found += shares[0].argmax() == room
        far.append(np.abs(away[0] / np.maximum(distance.astype(np.float32), NEAREST) - 1).mean())
        for n in range(len(CLASSES)):
            one, other = (kinds == n) & known, label == n
            hits[n] += (one & other).sum()
            union[n] += (one | other).sum()
    print(f"{len(images)} frames: pixels {100 * right / counted:.1f} %, rooms {100 * found / len(images):.1f} %, ", end="")
    print(f"distance off by {100 * np.mean(far):.1f} %, mean IoU {100 * np.mean(hits[union > 0] / union[union > 0]):.1f} %")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="darkqa-eval")
    parser.add_argument("--work", type=pathlib.Path, required=True)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path(__file__).with_name("room-net.onnx"))
    parser.add_argument("--epochs", type=int, default=30)
    parser.add_argument("--batch", type=int, default=16)
    said = parser.parse_args()
    learned = gather(said.program, said.work, LEARNED)
    export(train(learned, said.epochs, said.batch), said.out)
    print(f"{said.out}: {said.out.stat().st_size} bytes")
    measure(said.out, gather(said.program, said.work, HELD_OUT))


if __name__ == "__main__":
    main()
