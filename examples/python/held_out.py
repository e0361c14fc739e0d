# Held-out errors of a calibration, as a notebook: each "# %%" begins a cell in editors that know them.
# As a script: held_out.py CAPTURES OUT [BOARD]; it writes OUT/held-out.png.

# %% What to solve: a captures folder, or photographs of a board with the board's name.
import pathlib
import sys

import matplotlib

if __name__ == "__main__" and not hasattr(sys, "ps1"):
    matplotlib.use("Agg")  # a script without a display
import matplotlib.pyplot as plt

import limn

if len(sys.argv) not in (3, 4):
    sys.exit("held_out.py CAPTURES OUT [BOARD]")
captures, out = sys.argv[1], pathlib.Path(sys.argv[2])
board = sys.argv[3] if len(sys.argv) == 4 else ""

# %% Solve. Each board pose is also predicted by a solve without it: that is its held-out error.
try:
    found = limn.solve(captures, out, board=board, cameras_only=bool(board))
except limn.Error as error:
    sys.exit(str(error))
print(found.explanation)

# %% The poses, worst first, beside the residual of the fit, which is usually smaller.
poses = sorted(found.held_out, key=lambda pose: pose.rms_px, reverse=True)
figure, axes = plt.subplots(figsize=(8, 0.8 + 0.35 * len(poses)), layout="constrained")
axes.barh([pose.pose for pose in poses], [pose.rms_px for pose in poses], color="tab:blue", label="held-out, each pose")
axes.axvline(found.held_out_rms_px, color="tab:red", label=f"held-out, all: {found.held_out_rms_px:.3f} px")
for i, device in enumerate(found.devices):
    axes.axvline(device.rms_px, color="grey", linestyle=[":", "--", "-."][i % 3],
                 label=f"fit, {device.name}: {device.rms_px:.3f} px")  # fmt: skip
axes.invert_yaxis()
axes.set_xlabel("error, pixels RMS")
axes.set_title(f"{found.verdict}: {len(poses)} board poses")
axes.legend(loc="lower right", fontsize="small")

# %% Keep it.
figure.savefig(out / "held-out.png", dpi=100)
print(out / "held-out.png")
