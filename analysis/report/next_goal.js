"use strict";
/* Shows the postures for one position of the goal, which the slider chooses or a pointer drags. */
document.querySelectorAll(".touch").forEach((root) => {
  const slider = root.querySelector("input");
  const centres = [...root.querySelector("svg").querySelectorAll(".moved")]
    .map((goal) => [Number(goal.getAttribute("cx")), Number(goal.getAttribute("cy"))]);

  const show = () => {
    root.querySelectorAll("[data-place]").forEach((part) => {
      part.classList.toggle("shown", part.dataset.place === slider.value);
    });
    const [x, y] = centres[Number(slider.value)];
    root.querySelectorAll(".handle").forEach((handle) => handle.setAttribute("transform", `translate(${x} ${y})`));
    const words = [...root.querySelectorAll(".facts")].map((facts) => {
      const [name, place] = [facts.querySelector("strong"), facts.querySelector(".shown")];
      return `${name.textContent}: ${place.textContent}`;
    });
    slider.setAttribute("aria-valuetext", words.join(" "));
  };

  root.querySelectorAll("svg").forEach((svg) => {
    const handle = svg.querySelector(".handle");
    const follow = (event) => {
      const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      const distances = centres.map(([x, y]) => Math.hypot(x - at.x, y - at.y));
      slider.value = distances.indexOf(Math.min(...distances));
      slider.dispatchEvent(new Event("input", { bubbles: true }));
    };
    handle.addEventListener("pointerdown", (event) => {
      handle.setPointerCapture(event.pointerId);
      follow(event);
    });
    /* A finger that drags the goal does not scroll the page; touch-action is not heeded within an SVG. */
    handle.addEventListener("touchstart", (event) => event.preventDefault(), { passive: false });
    handle.addEventListener("pointermove", (event) => {
      if (handle.hasPointerCapture(event.pointerId)) follow(event);
    });
  });
  slider.addEventListener("input", show);
  slider.parentElement.hidden = false;
  root.classList.add("live");
  show();
});
