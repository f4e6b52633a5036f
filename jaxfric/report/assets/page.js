"use strict";
// Draws the page's pictures by uPlot: hover shows values with units, drag zooms, double-click
// resets. Colours are those of the style sheet, so that dark mode and paper follow it.
(() => {
  const style = (name) =>
    getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const pale = (colour, share) => `color-mix(in srgb, ${colour} ${share}%, transparent)`;
  const digits = (value) =>
    value == null ? "–" : String(Number(value.toPrecision(4)));
  const shown = (value, unit) => (value == null ? "–" : `${digits(value)} ${unit}`.trim());

  // Bars of points: the two columns after the series' own.
  const bars = (places) => (plot) => {
    const { ctx } = plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(plot.bbox.left, plot.bbox.top, plot.bbox.width, plot.bbox.height);
    ctx.clip();
    ctx.lineWidth = devicePixelRatio;
    for (const [place, key] of places) {
      if (!plot.series[place].show) continue;
      ctx.strokeStyle = style(key);
      ctx.beginPath();
      plot.data[0].forEach((x, i) => {
        const [low, high] = [plot.data[place + 1][i], plot.data[place + 2][i]];
        if (low == null || high == null) return;
        const at = plot.valToPos(x, "x", true);
        ctx.moveTo(at, plot.valToPos(low, "y", true));
        ctx.lineTo(at, plot.valToPos(high, "y", true));
      });
      ctx.stroke();
    }
    ctx.restore();
  };

  const hidden = { show: true, paths: () => null, points: { show: false }, class: "unlisted" };

  const options = (spec, width) => {
    const series = [{ label: spec.x.label, value: (_, v) => shown(v, spec.x.unit) }];
    const [bands, barred] = [[], []];
    for (const each of spec.series) {
      const place = series.length;
      const value = (_, v) => shown(v, spec.y.unit);
      const stroke = () => style(each.key);
      if (each.kind === "band") {
        series.push({ ...hidden, label: "" }, { ...hidden, label: "" });
        series[place] = { ...hidden, label: "", paths: uPlot.paths.linear(), stroke: () => "#0000" };
        series[place + 1] = { ...series[place] };
        bands.push({ series: [place + 1, place], fill: () => pale(style(each.key), 22) });
        continue;
      }
      const points =
        each.kind === "points"
          ? { show: true, size: 5, width: 0, fill: stroke, stroke }
          : { show: false };
      const paths = each.kind === "points" ? () => null : undefined;
      series.push({ label: each.label, value, stroke, width: each.width, points, paths });
      if (each.bars) {
        barred.push([place, each.key]);
        series.push({ ...hidden, label: "" }, { ...hidden, label: "" });
      }
    }
    const axis = (label, size) => ({
      label, size, labelSize: 22, font: "12px system-ui", labelFont: "12px system-ui",
      stroke: () => style("text"),
      grid: { stroke: () => style("line"), width: 1 },
      ticks: { stroke: () => style("line"), width: 1 },
      values: (_, ticks) => ticks.map((v) => String(Number(v.toPrecision(10)))),
    });
    return {
      width,
      height: spec.height,
      scales: { x: { time: false } },
      axes: [axis(spec.x.label, 34), axis(spec.y.label, 56)],
      series,
      bands,
      legend: { live: true, markers: { fill: (plot, n) => plot.series[n].stroke(plot, n) } },
      cursor: { points: { size: 8 }, drag: { x: true, y: false } },
      hooks: { draw: barred.length ? [bars(barred)] : [] },
    };
  };

  // Where curve and points stand at different places a missing value is none, and a gap at zero.
  const data = (spec) =>
    !spec.through
      ? spec.data
      : spec.data.map((column, n) =>
          n ? column.map((v, i) => (v === null && spec.data[0][i] !== 0 ? undefined : v)) : column);

  // Paper is white, and a sheet that many pixels wide between its margins.
  const PAPER = 640;
  const onPaper = () => document.documentElement.classList.contains("paper");
  const drawn = [];
  for (const place of document.querySelectorAll(".chart")) {
    const spec = JSON.parse(place.querySelector("script").textContent);
    const width = () => onPaper() ? Math.min(PAPER, place.clientWidth) : Math.max(240, place.clientWidth);
    const plot = new uPlot(options(spec, width()), data(spec), place);
    drawn.push({ plot, place, spec, width });
    place.dataset.drawn = "yes";
  }
  const fit = () => drawn.forEach(({ plot, spec, width }) => {
    if (plot.width !== width()) plot.setSize({ width: width(), height: spec.height });
  });
  const again = () => drawn.forEach(({ plot }) => plot.redraw(false, true));
  new ResizeObserver(fit).observe(document.body);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
  const paper = (on) => () => {
    document.documentElement.classList.toggle("paper", on);
    fit();
    again();
  };
  addEventListener("beforeprint", paper(true));
  addEventListener("afterprint", paper(false));

  for (const button of document.querySelectorAll("button.copy")) {
    button.addEventListener("click", async () => {
      const code = button.parentElement.querySelector("pre").textContent;
      try {
        await navigator.clipboard.writeText(code);
        button.textContent = "copied";
      } catch {
        const range = document.createRange();
        range.selectNodeContents(button.parentElement.querySelector("pre"));
        getSelection().removeAllRanges();
        getSelection().addRange(range);
        button.textContent = "selected: press Ctrl+C";
      }
    });
  }
})();
