"use strict";
/* Shows the postures for one position of a goal. The list chooses the goal, the slider or a pointer its position. */
document.querySelectorAll(".touch").forEach((root) => {
  const [choice, slider] = [root.querySelector("select"), root.querySelector("input")];
  const moves = [...root.querySelectorAll("[data-goal]")];

  const show = () => {
    moves.forEach((each) => { each.hidden = each.dataset.goal !== choice.value; });
    const move = moves.find((each) => !each.hidden);
    slider.max = move.querySelector("svg").querySelectorAll(".moved").length - 1;
    move.querySelectorAll("[data-place]").forEach((part) => {
      part.classList.toggle("shown", part.dataset.place === slider.value);
    });
    move.querySelectorAll("svg").forEach((svg) => {
      const goal = svg.querySelector(".shown .moved");
      ["cx", "cy"].forEach((at) => svg.querySelector(".handle").setAttribute(at, goal.getAttribute(at)));
    });
    const words = [...move.querySelectorAll(".facts")].map((facts) => {
      const [name, place] = [facts.querySelector("strong"), facts.querySelector(".shown")];
      return `${name.textContent} ${place.textContent}`;
    });
    slider.setAttribute("aria-valuetext", words.join(" "));
  };

  root.querySelectorAll("svg").forEach((svg) => {
    const handle = svg.querySelector(".handle");
    const follow = (event) => {
      const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      const distances = [...svg.querySelectorAll(".moved")]
        .map((goal) => Math.hypot(goal.getAttribute("cx") - at.x, goal.getAttribute("cy") - at.y));
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
  choice.addEventListener("change", show);
  slider.addEventListener("input", show);
  slider.parentElement.hidden = false;
  root.classList.add("live");
  show();
});
