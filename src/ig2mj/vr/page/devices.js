// What the headset, or mouse and keyboard, say: messages for `messages.py`.

const SIDES = ["left", "right"];

function row(pose) {
  const {position: p, orientation: q} = pose.transform;
  return [p.x, p.y, p.z, q.x, q.y, q.z, q.w];
}

// Of one XR frame; also gives the grips' matrices and the gamepads, for ghosts and pulses.
export function readHeadset(frame, space) {
  const viewer = frame.getViewerPose(space);
  const hands = [{}, {}], grips = [null, null], pads = [null, null];
  for (const source of frame.session.inputSources) {
    const k = SIDES.indexOf(source.handedness);
    if (k < 0) continue;
    const pose = source.gripSpace ? frame.getPose(source.gripSpace, space) : null;
    const pad = source.gamepad;
    if (pose && !pose.emulatedPosition) grips[k] = pose.transform.matrix;
    hands[k] = {pose: pose ? row(pose) : null};
    if (!pad) continue;
    pads[k] = pad;
    const value = (n) => Math.min(Math.max(pad.buttons[n]?.value ?? 0, 0), 1);
    // "xr-standard": button 0 trigger, 1 squeeze; axes 2, 3 of the thumbstick, 0, 1 of a touchpad; down is positive.
    const first = pad.axes.length >= 4 ? 2 : 0;
    const stick = [pad.axes[first] ?? 0, -(pad.axes[first + 1] ?? 0)].map((v) => Math.min(Math.max(v, -1), 1));
    let buttons = 0;
    pad.buttons.forEach((button, n) => { if (button.pressed && n < 16) buttons |= 1 << n; });
    hands[k] = {...hands[k], trigger: value(0), squeeze: value(1), stick, buttons};
    if (pose) grips[k] = pose.transform.matrix;
  }
  const message = {type: "devices", time: performance.now() / 1000, head: viewer ? row(viewer) : null, hands};
  return {message, grips, pads};
}

export function pulse(pad, strength, ms) {
  const actuator = pad?.hapticActuators?.[0] ?? pad?.vibrationActuator;
  actuator?.pulse?.(strength, ms);
}

// Keys that are held, and what the mouse did since the last message.
export class Desktop {
  constructor(canvas) {
    this.down = new Set();
    this.move = [0, 0];
    this.wheel = 0;
    this.buttons = 0;
    this.used = false;
    const key = (event) => event.key.toLowerCase();
    addEventListener("keydown", (event) => { this.used = true; this.down.add(key(event)); });
    addEventListener("keyup", (event) => this.down.delete(key(event)));
    addEventListener("blur", () => { this.down.clear(); this.buttons = 0; });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("mousemove", (event) => { this.move[0] += event.movementX; this.move[1] += event.movementY; });
    for (const name of ["mousedown", "mouseup"]) canvas.addEventListener(name, (event) => { this.used = true; this.buttons = event.buttons; });
    canvas.addEventListener("wheel", (event) => { this.wheel += event.deltaY; event.preventDefault(); }, {passive: false});
  }

  read() {
    const down = [...this.down].filter((name) => name.length <= 16).slice(0, 16);
    const message = {type: "desktop", down, move: this.move, wheel: this.wheel, buttons: this.buttons & 63};
    this.move = [0, 0];
    this.wheel = 0;
    return message;
  }
}
