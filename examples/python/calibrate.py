"""Calibrates projectors and cameras from a captures folder, or cameras from photographs of a board.

Usage: calibrate.py CAPTURES OUT [BOARD]
BOARD is that of the photographs, such as charuco:8x6:40mm. Ends with 1 if the result should not be used.
"""

import sys

import limn


def report(progress):
    steps = f" {progress.done}/{progress.total}" if progress.total else ""
    print(f"{progress.stage}{steps}", file=sys.stderr)
    return True  # False would stop; so does Ctrl-C


def main(captures, out, board=""):
    limn.set_log(lambda is_warning, line: print("warning:" if is_warning else "note:", line, file=sys.stderr))
    found = limn.solve(captures, out, board=board, cameras_only=bool(board), progress=report)
    print(found.explanation)
    for device in found.devices:
        print(f"{device.name}: {device.rms_px:.3f} px, {device.points} points, {100 * device.coverage:.0f} % of the image")
    print(f"held-out {found.held_out_rms_px:.3f} px")
    for camera in found.rig.cameras:
        print(f"{camera.name}: {camera.lens_model}, focal lengths {camera.lens_values[:2].round(1)} px")
    for fault in found.faults:
        print(fault.text)
    for sentence in found.advice:
        print(sentence)
    print(f"report: {found.report_html}")
    return 1 if found.verdict == "reject" else 0


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    try:
        sys.exit(main(*sys.argv[1:]))
    except limn.Error as error:
        sys.exit(str(error))
