"""Minimax polynomials of sine and cosine on [-pi/4, pi/4] by Remez exchange, in 60 digits."""
import mpmath as mp
mp.mp.dps = 60
def remez(f, w, a, b, n, rounds=30):
    """p of degree n-1 minimising max |w (p - f)| on [a,b]."""
    x = [(a+b)/2 + (b-a)/2*mp.cos(mp.pi*(2*k+1)/(2*(n+1))) for k in range(n+1)][::-1]
    for _ in range(rounds):
        A = mp.matrix(n+1, n+1); r = mp.matrix(n+1,1)
        for i, xi in enumerate(x):
            for j in range(n): A[i,j] = xi**j
            A[i,n] = (-1)**i / w(xi); r[i] = f(xi)
        s = mp.lu_solve(A, r)
        err = lambda t: w(t)*(sum(s[j]*t**j for j in range(n)) - f(t))
        N = 400; g = [a+(b-a)*k/mp.mpf(N) for k in range(N+1)]; e=[err(t) for t in g]
        new=[]; k=0
        while k<=N:
            sg = mp.sign(e[k]); best=k
            while k<=N and mp.sign(e[k])==sg:
                if abs(e[k])>abs(e[best]): best=k
                k+=1
            new.append(g[best])
        if len(new) != n+1: break
        x=new
    return s, max(abs(t) for t in e)
b=(mp.pi/4)**2; a=mp.mpf('1e-12')
# sin x = x + x^3 P(x^2); cos x = 1 - x^2/2 + x^4 Q(x^2)
P,e1=remez(lambda z:(mp.sin(mp.sqrt(z))/mp.sqrt(z)-1)/z, lambda z:z, a, b, 6)
Q,e2=remez(lambda z:(mp.cos(mp.sqrt(z))-1+z/2)/z**2, lambda z:z**2, a, b, 6)
print(e1,e2)
for s in (P,Q): print([float(c) for c in list(s)[:6]])
pio2=mp.pi/2
hi=mp.mpf(int(pio2*2**32))/2**32   # 33 bits
print(float(hi), float(pio2-hi), float(hi).hex(), float(pio2-hi).hex())
