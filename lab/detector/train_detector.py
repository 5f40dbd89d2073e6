"""Trains pyramid, relief and heads on a frozen backbone; continues from OUT/checkpoint.pt if it is there.

python3 train_detector.py CROPS OUT --backbone efficientnet-lite0.pth [--negatives FOLDER] [--minutes N]

OUT/model.pt holds the running mean of the weights in half precision, without the backbone; OUT/loss.csv the
step, the means of the five losses over the last steps, and seconds and processor seconds a step.
"""

import argparse
import time
from pathlib import Path

import torch

from crops import Crops, collate
from model import Detector

PRINT_STEPS = 20
# Weights of the running mean that is evaluated and shipped.
MEAN_DECAY = 0.998
# Largest norm of the gradient.
MOST_GRADIENT = 5.0


def arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("crops")
    parser.add_argument("out", type=Path)
    parser.add_argument("--backbone", required=True)
    parser.add_argument("--negatives")
    parser.add_argument("--minutes", type=float, default=1e9)
    parser.add_argument("--batch", type=int, default=2)
    parser.add_argument("--rate", type=float, default=5e-4)
    parser.add_argument("--warmup", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--save-minutes", type=float, default=4)
    parser.add_argument("--start", help="a model.pt to start from, with new moments of the optimizer")
    return parser.parse_args()


class Training:
    """The model, its optimizer, the running mean of its weights, and how far it has come."""

    def __init__(self, args):
        self.model = Detector()
        self.model.backbone.body.load_package(args.backbone)
        self.model.backbone.body.requires_grad_(False)
        self.model.to(memory_format=torch.channels_last).train()
        self.parameters = {name: p for name, p in self.model.named_parameters() if p.requires_grad}
        self.optimizer = torch.optim.AdamW(self.parameters.values(), lr=args.rate, weight_decay=1e-4)
        self.step, self.rate, self.warmup = 0, args.rate, args.warmup
        state = {}
        if (args.out / "checkpoint.pt").exists():
            state = torch.load(args.out / "checkpoint.pt")
            self.model.load_state_dict(state["weights"], strict=False)
            self.optimizer.load_state_dict(state["optimizer"])
            self.step = state["step"]
        elif args.start:
            state = torch.load(args.start)
            self.model.load_state_dict({k: v.float() for k, v in state["weights"].items()}, strict=False)
        self.mean = state.get("mean") or {name: p.detach().clone() for name, p in self.parameters.items()}

    def learn(self, images, relief, present, targets):
        """One step; returns the losses."""
        for group in self.optimizer.param_groups:
            group["lr"] = self.rate * min(1, (self.step + 1) / self.warmup)
        losses = self.model.losses(images, relief if present.any() else None, present, targets)
        total = sum(losses.values())
        if not torch.isfinite(total):
            raise SystemExit(f"step {self.step}: the loss is not finite")
        self.optimizer.zero_grad(set_to_none=True)
        total.backward()
        torch.nn.utils.clip_grad_norm_(self.parameters.values(), MOST_GRADIENT)
        self.optimizer.step()
        self.step += 1
        decay = min(MEAN_DECAY, (1 + self.step) / (10 + self.step))
        with torch.no_grad():
            for name, value in self.mean.items():
                value.lerp_(self.parameters[name], 1 - decay)
        return {name: float(value.detach()) for name, value in losses.items()}

    def save(self, out):
        """Writes the state to continue from and the mean weights to use, each complete or not at all."""
        state = {
            "step": self.step,
            "mean": self.mean,
            "weights": {name: p.detach() for name, p in self.parameters.items()},
            "optimizer": self.optimizer.state_dict(),
        }
        half = {name: value.half() for name, value in self.mean.items()}
        for name, content in ("checkpoint.pt", state), ("model.pt", {"step": self.step, "weights": half}):
            torch.save(content, out / f"{name}.part")
            (out / f"{name}.part").rename(out / name)


class Log:
    """Means over the last steps, written to loss.csv."""

    def __init__(self, out):
        self.file = open(out / "loss.csv", "a", buffering=1)
        self.begin()

    def begin(self):
        self.sums, self.since, self.cpu = {}, time.time(), time.process_time()

    def add(self, step, losses):
        for name, value in losses.items():
            self.sums[name] = self.sums.get(name, 0) + value / PRINT_STEPS
        if step % PRINT_STEPS == 0:
            times = (time.time() - self.since) / PRINT_STEPS, (time.process_time() - self.cpu) / PRINT_STEPS
            values = [f"{value:.4f}" for value in self.sums.values()] + [f"{value:.2f}" for value in times]
            print(step, *values, sep=",", file=self.file)
            self.begin()


def main():
    args = arguments()
    torch.set_num_threads(args.threads)
    torch.manual_seed(args.seed)
    args.out.mkdir(parents=True, exist_ok=True)
    training, log = Training(args), Log(args.out)
    crops = Crops(args.crops, args.negatives, args.seed + 1000 * training.step)
    batches = torch.utils.data.DataLoader(crops, args.batch, num_workers=1, collate_fn=collate)
    begun = saved = time.time()
    for batch in batches:
        log.add(training.step + 1, training.learn(*batch))
        is_over = time.time() - begun > 60 * args.minutes
        if is_over or time.time() - saved > 60 * args.save_minutes:
            training.save(args.out)
            saved = time.time()
        if is_over:
            break


if __name__ == "__main__":
    main()
