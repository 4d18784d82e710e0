/**
 * three's Basis Universal transcoder, made fit for a strict content security policy. Its glue builds
 * the functions between JavaScript and WebAssembly out of text, which needs 'unsafe-eval'
 * (https://github.com/mrdoob/three.js/issues/34389); closures do the same.
 */

/** A function of C++ as one of JavaScript; `types` are the result's, the object's, the arguments'. */
function bound(name, types, isMethod, invoker, target) {
  const [result, object, ...parameters] = types;
  const wiring = isMethod ? [object, ...parameters] : parameters;
  const stacked = usesDestructorStack(types);
  return function (...given) {
    if (given.length !== parameters.length) {
      throwBindingError(`${name} takes ${parameters.length} arguments and was given ${given.length}`);
    }
    const destructors = stacked ? [] : null;
    const values = isMethod ? [this, ...given] : given;
    const wired = wiring.map((type, i) => type.toWireType(destructors, values[i]));
    const answer = invoker(target, ...wired);
    if (stacked) runDestructors(destructors);
    else wiring.forEach((type, i) => type.destructorFunction?.(wired[i]));
    return result.name === "void" ? undefined : result.fromWireType(answer);
  };
}

/** A function of JavaScript as one of C++: its arguments lie one behind the other in memory. */
function calledBack(result, types, kind) {
  return function (object, called, destructors, memory) {
    let at = memory;
    const values = types.map((type) => {
      const value = type.readValueFromPointer(at);
      at += type.argPackAdvance;
      return value;
    });
    const answer =
      kind === 1 ? new called(...values) : called.call(...(kind === 0 ? [object] : []), ...values);
    return result.isVoid ? undefined : emval_returnValue(result, destructors, answer);
  };
}

const CLOSURES = [
  ["newFunc(Function,args)(...closureArgs)", "bound(humanName,argTypes,isClassMethodFunc,cppInvokerFunc,cppTargetFunc)"],
  ["newFunc(Function,params)(...args)", "calledBack(retType,types,kind)"],
];

const BODY = "function(moduleArg = {}) {";

/** The glue's text with both places where it evaluates text changed; throws where they are gone. */
export function strict(glue) {
  for (const [evaluated, closed] of CLOSURES) {
    if (glue.split(evaluated).length !== 2) {
      throw new Error(`the transcoder changed: look for what became of ${evaluated}`);
    }
    glue = glue.replace(evaluated, () => closed);
  }
  // Inside the module's own function, where what they call is in sight.
  const body = glue.indexOf(BODY) + BODY.length;
  if (body < BODY.length) throw new Error("the transcoder changed: where does its module begin?");
  return `${glue.slice(0, body)}${bound}${calledBack}${glue.slice(body)}`;
}
