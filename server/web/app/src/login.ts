// Asks for the token.

import {post, type ApiError} from "./api.js";
import {el, labelled} from "./dom.js";
import type {View} from "./view.js";

export function loginView(done: () => void): View {
  const token = el("input", {type: "password", autocomplete: "current-password", required: true});
  const error = el("p", {class: "error", role: "alert"});
  const go = el("button", {type: "submit", class: "primary"}, "Enter");
  const enter = async (): Promise<void> => {
    error.textContent = "";
    go.disabled = true;  // until the token is refused: done() is called once
    try {
      await post("/v1/session", {token: token.value.trim()});
      done();
    } catch (failure) {
      const {code, message} = failure as ApiError;
      error.textContent = code === 401 ? "The server does not know this token." : message;
      go.disabled = false;
      token.focus();
      token.select();
    }
  };
  const element = el("form", {class: "login", submit: (e) => { e.preventDefault(); void enter(); }},
                     el("h1", {}, "Who are you?"),
                     labelled("Token", token, "The operator of this server gave it to you."), error, go);
  return {title: "Token", element};
}
