//! ArduPilot's slew limiter (SMAX): it counts how often the demand swings too fast in both directions
//! and lowers P and D while it does.

use crate::autopilots::one_pole::newest_weight;
use num_traits::{Float, FloatConst};

const CUTOFF_HZ: f64 = 25.0;
const WINDOW_MS: u32 = 300;
const EVENTS: usize = 2;
const MODIFIER_GAIN: f64 = 1.5;
/// The largest slew rate that counts, over SMAX: gains are not lowered further.
const LARGEST_RATIO: f64 = 10.0;
/// The limiter's clock at the first loop: an autopilot has been on for long when it flies.
const START_MS: u32 = 1_000_000;

/// One direction of the swing.
#[derive(Debug, Clone)]
struct Side<F> {
    largest: F,
    largest_ms: u32,
    event_ms: [u32; EVENTS],
    next: usize,
    stored: bool,
}

impl<F: Float> Side<F> {
    fn new() -> Self {
        Self { largest: F::zero(), largest_ms: 0, event_ms: [0; EVENTS], next: 0, stored: false }
    }

    /// Note that the limit was passed; true if this is news.
    fn store(&mut self, now_ms: u32) -> bool {
        if self.stored {
            return false;
        }
        self.event_ms[self.next % EVENTS] = now_ms;
        self.next = self.next % EVENTS + 1;
        self.stored = true;
        true
    }

    fn track(&mut self, slew_rate: F, limit: F, now_ms: u32, decay: F) {
        if slew_rate > self.largest {
            self.largest = slew_rate.min(limit);
            self.largest_ms = now_ms;
        } else if now_ms - self.largest_ms > WINDOW_MS {
            self.largest = self.largest * (F::one() - decay);
        }
    }
}

/// State of the limiter of one axis.
#[derive(Debug, Clone)]
pub struct SlewLimiter<F> {
    limit: F,
    tau_s: F,
    constants: [F; 4],
    filtered: F,
    last: F,
    rising: Side<F>,
    falling: Side<F>,
    for_gain: F,
    output: F,
    loops: u32,
}

impl<F: Float + FloatConst> SlewLimiter<F> {
    /// A limiter with SMAX and the time constant of its decay, s. None for constants that `F` lacks.
    pub fn new(limit: F, tau_s: F) -> Option<Self> {
        let zero = F::zero();
        Some(Self {
            limit,
            tau_s,
            constants: [
                F::from(CUTOFF_HZ)?,
                F::from(MODIFIER_GAIN)?,
                F::from(LARGEST_RATIO)?,
                F::from(0.001)?,
            ],
            filtered: zero,
            last: zero,
            rising: Side::new(),
            falling: Side::new(),
            for_gain: zero,
            output: zero,
            loops: 0,
        })
    }

    /// Slew rate that the autopilot logs as SRate.
    pub fn slew_rate(&self) -> F {
        self.output
    }

    /// Factor of P and D from the demand of the loop before.
    pub fn modifier(&mut self, sample: F, dt: F) -> F {
        if self.limit <= F::zero() {
            return F::one();
        }
        let [cutoff, gain, ratio, milli] = self.constants;
        let elapsed = F::from(self.loops).unwrap_or_else(F::zero) * dt / milli;
        let now_ms = START_MS + elapsed.to_u32().unwrap_or(0);
        self.loops += 1;
        let slew = (sample - self.last) / dt;
        self.filtered = self.filtered + (slew - self.filtered) * newest_weight(dt, cutoff);
        self.last = sample;
        let rate = self.filtered;
        self.count(rate, now_ms);
        let decay = dt.min(self.tau_s) / self.tau_s;
        self.rising.track(rate, ratio * self.limit, now_ms, decay);
        self.falling.track(-rate, ratio * self.limit, now_ms, decay);
        let half = F::one() / (F::one() + F::one());
        let raw = half * (self.rising.largest + self.falling.largest);
        let attack = (decay + decay).min(F::one());
        let faded = raw * self.fading(now_ms, milli);
        self.for_gain = attacked(self.for_gain, faded, attack);
        self.output = attacked(self.output, raw, attack);
        if self.for_gain > self.limit {
            self.limit / (self.limit + gain * (self.for_gain - self.limit))
        } else {
            F::one()
        }
    }

    fn count(&mut self, rate: F, now_ms: u32) {
        if rate > self.limit && self.rising.store(now_ms) {
            self.falling.stored = false;
        }
        if rate < -self.limit && self.falling.store(now_ms) {
            self.rising.stored = false;
        }
    }

    /// Below one once the oldest of the counted swings is out of date.
    fn fading(&self, now_ms: u32, milli: F) -> F {
        let sides = self.rising.event_ms.iter().chain(&self.falling.event_ms);
        let age_ms = now_ms - sides.copied().min().unwrap_or(now_ms).min(now_ms);
        let window_ms = (EVENTS as u32 + 1) * WINDOW_MS;
        if age_ms <= window_ms {
            return F::one();
        }
        let late_s = milli * F::from(age_ms - window_ms).unwrap_or_else(F::zero);
        (-late_s / self.tau_s).exp()
    }
}

fn attacked<F: Float>(state: F, input: F, weight: F) -> F {
    ((F::one() - weight) * state + weight * input).min(input)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn last_modifier(amplitude: f64, limit: f64) -> f64 {
        let mut limiter = SlewLimiter::new(limit, 1.0).unwrap();
        let dt = 0.0025;
        (0..4000)
            .map(|k| {
                let angle = std::f64::consts::TAU * 8.0 * f64::from(k) * dt;
                limiter.modifier(amplitude * angle.sin(), dt)
            })
            .last()
            .unwrap()
    }

    #[test]
    fn a_slow_demand_is_left_alone_and_a_fast_one_lowered() {
        // Slew of 0.1 sin(2π 8 t) behind 25 Hz: 0.1·2π·8·0.953 = 4.79 per second.
        assert_eq!(last_modifier(0.1, 5.0), 1.0);
        let lowered = last_modifier(0.1, 2.0);
        let expected = 2.0 / (2.0 + 1.5 * (0.1 * std::f64::consts::TAU * 8.0 * 0.953 - 2.0));
        assert!((lowered - expected).abs() < 0.02, "{lowered} {expected}");
    }

    #[test]
    fn zero_is_off() {
        assert_eq!(last_modifier(10.0, 0.0), 1.0);
    }
}
