"use strict";
(function () {
  const phone = window.matchMedia("(max-width: 900px)");
  const config = { responsive: true, displayModeBar: false };

  function arrange(plot) {
    const layouts = plot.layout.meta;
    if (!layouts) return Promise.resolve();
    plot.style.minHeight = "";
    return Plotly.relayout(plot, structuredClone(phone.matches ? layouts.narrow : layouts.wide));
  }

  async function draw(figure) {
    const select = figure.querySelector("select");
    const place = figure.dataset.place + "-" + (select ? select.value : 1);
    const plot = figure.querySelector(".plot");
    const content = JSON.parse(document.getElementById(place).textContent);
    content.config = config;
    Plotly.purge(plot);
    await Plotly.newPlot(plot, content);
    await arrange(plot);
    figure.dataset.drawn = place;
  }

  for (const figure of document.querySelectorAll("figure.picture")) {
    const select = figure.querySelector("select");
    if (select) select.addEventListener("change", () => draw(figure));
    draw(figure);
  }
  // A slider moved during play ends the animation, which Plotly tells by rejecting without a reason.
  window.addEventListener("unhandledrejection", (event) => {
    if (event.reason === undefined) event.preventDefault();
  });
  phone.addEventListener("change", () => {
    document.querySelectorAll("figure.picture .plot.js-plotly-plot").forEach(arrange);
  });
})();
