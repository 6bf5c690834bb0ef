// The page put together: theme, data, then every section.
"use strict";
(() => {
  const root = document.documentElement;

  function themed(theme) {
    root.dataset.theme = theme;
    D.state.set({ theme });
  }

  function about(page) {
    const { thinned, notes } = page, e = D.element;
    const lines = [
      `Made with ${page.made_with}; this one file is all there is, it asks no network.`,
      thinned &&
        `Drawn are ${D.format.number(thinned.points)} of ${D.format.number(thinned.of)} points: ` +
          `the others stand nearer than ${thinned.tolerance_mm} mm to the lines drawn.`,
      ...notes,
    ].filter(Boolean);
    document.getElementById("about").append(
      e("h2", {}, "About this report"),
      e("ul", { class: "note" }, ...lines.map((line) => e("li", {}, line))),
    );
  }

  async function shown() {
    const dark = matchMedia("(prefers-color-scheme: dark)");
    themed(dark.matches ? "dark" : "light");
    dark.addEventListener("change", () => themed(dark.matches ? "dark" : "light"));
    document.getElementById("theme").addEventListener("click", () =>
      themed(D.state.get().theme === "dark" ? "light" : "dark"));
    const page = await D.load();
    document.getElementById("title").textContent = page.title;
    D.state.set({
      colour: page.plans[1].heads.length > 1 ? "head" : "role",
      time: Math.max(...page.plans.map((plan) => plan.end_s)),
      layers: [0, Math.max(0, page.contours.layer.reduce((a, b) => Math.max(a, b), 0))],
    });
    for (const section of ["facts", "view", "gantt", "charts"])
      if (D[section]) await D[section].show(page);
    about(page);
    document.getElementById("loading").remove();
    for (const link of document.querySelectorAll("#head nav a"))
      link.hidden = !document.querySelector(link.getAttribute("href")).childElementCount;
  }

  D.ready = shown().catch((error) => {
    const line = document.getElementById("loading");
    line.className = "warning";
    line.textContent = `This report cannot be shown: ${error.message}.`;
    throw error;
  });
})();
