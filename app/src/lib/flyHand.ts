import type { Hand, Sticks } from "./fly.svelte";

/** Keys by the axis that they move, and which way. */
export const KEYS: Record<string, [Hand, number]> = {
  ArrowDown: ["pitch", 1], ArrowUp: ["pitch", -1], ArrowRight: ["roll", 1], ArrowLeft: ["roll", -1],
  d: ["yaw", 1], a: ["yaw", -1], w: ["heave", 1], s: ["heave", -1],
};
/** Share of the travel that a key reaches, and with Shift. */
const [KEY_REACH, FAR] = [0.25, 1];
const KEY_RATE = 1.2;
const BACK_RATE = 2.5;
const DEAD = 0.06;

/** A hand: keys move a stick steadily and let it come back; a mouse or a gamepad places it. */
export class FlyHand {
  readonly held = new Set<string>();
  placed: Partial<Sticks> = {};
  /** Whether Shift is held. */
  far = false;
  #keyed: Sticks = { pitch: 0, roll: 0, yaw: 0, heave: 0 };

  press(key: string) {
    const name = key.length === 1 ? key.toLowerCase() : key;
    if (!(name in KEYS)) return false;
    this.held.add(name);
    return true;
  }
  release(key: string) { this.held.delete(key.length === 1 ? key.toLowerCase() : key); }
  letGo() { this.held.clear(); this.far = false; this.placed = {}; }

  /** Name of the gamepad that is read; empty: none. */
  get pad() { return navigator.getGamepads?.().find((each) => each?.connected)?.id ?? ""; }

  #padded(): Partial<Sticks> {
    const pad = navigator.getGamepads?.().find((each) => each?.connected);
    if (!pad) return {};
    const read = (place: number) => {
      const value = pad.axes[place] ?? 0;
      return Math.abs(value) < DEAD ? 0 : (value - Math.sign(value) * DEAD) / (1 - DEAD);
    };
    // Mode 2: left stick yaw and heave, right stick roll and pitch; pulled is positive.
    return { yaw: read(0), heave: -read(1), roll: read(2), pitch: read(3) };
  }

  /** Where it is after so many seconds. */
  moved(seconds: number): Sticks {
    const aim: Sticks = { pitch: 0, roll: 0, yaw: 0, heave: 0 };
    for (const key of this.held) aim[KEYS[key][0]] += (this.far ? FAR : KEY_REACH) * KEYS[key][1];
    const pad = this.#padded();
    const found = { ...this.#keyed };
    for (const axis of Object.keys(aim) as Hand[]) {
      const now = this.#keyed[axis];
      const most = (aim[axis] ? KEY_RATE : BACK_RATE) * seconds;
      this.#keyed[axis] = now + Math.max(-most, Math.min(most, aim[axis] - now));
      const sum = this.#keyed[axis] + (this.placed[axis] ?? 0) + (pad[axis] ?? 0);
      found[axis] = Number(Math.max(-1, Math.min(1, sum)).toFixed(4));
    }
    return found;
  }
}
