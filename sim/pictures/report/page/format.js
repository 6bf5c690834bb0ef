// Numbers and times as people read them.
"use strict";
(() => {
  const grouped = new Intl.NumberFormat("en", { maximumFractionDigits: 0 });
  const precise = new Intl.NumberFormat("en", { maximumFractionDigits: 1 });

  const two = (value) => String(value).padStart(2, "0");

  D.format = {
    /** 3909 -> "1:05:09". */
    clock(seconds) {
      const s = Math.max(0, Math.round(seconds));
      return `${Math.floor(s / 3600)}:${two(Math.floor(s / 60) % 60)}:${two(s % 60)}`;
    },
    /** 3909 -> "1 h 05 min"; 65.4 -> "1 min 05 s"; 2.34 -> "2.3 s". */
    duration(seconds) {
      const whole = Math.round(seconds);
      if (whole >= 3600) {
        const minutes = Math.round(seconds / 60);
        return `${Math.floor(minutes / 60)} h ${two(minutes % 60)} min`;
      }
      if (whole >= 60) return `${Math.floor(whole / 60)} min ${two(whole % 60)} s`;
      return `${seconds < 10 ? precise.format(seconds) : grouped.format(seconds)} s`;
    },
    /** 123456.7 -> "123.5 m"; 8320 -> "8,320 mm". */
    mm(value) {
      return value >= 100000 ? `${precise.format(value / 1000)} m` : `${grouped.format(value)} mm`;
    },
    /** 0.0123 -> "1.2 %"; 0.5 -> "50 %". */
    percent(share) {
      const value = 100 * share;
      return `${Math.abs(value) < 9.95 ? value.toFixed(1) : Math.round(value)} %`;
    },
    /** (1, "bead") -> "1 bead"; (1200, "bead") -> "1,200 beads". */
    count: (value, word) => `${grouped.format(value)} ${word}${value === 1 ? "" : "s"}`,
    number: (value) => (Math.abs(value) < 100 ? precise : grouped).format(value),
  };
})();
